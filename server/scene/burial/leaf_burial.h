// How much of one leaf lies inside a solid, or under a face that lies on it, and where on it one may stand. Plain
// values; leaves may be measured by several threads, each with a Scratch of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <optional>
#include <vector>

#include "server/scene/burial/burial_record.h"
#include "server/scene/burial/coverage.h"
#include "server/scene/burial/solids.h"

namespace radiosity::scene {

/// A side of a leaf that something comes near.
struct Contact {
  std::uint32_t surface, side, x, y;
};

class LeafBurial {
 public:
  enum class Answer : std::uint8_t { kNone, kVisible, kBuried };
  /// Of one thread.
  class Scratch {
   public:
    Hits hits;
    RayNotes notes;

   private:
    friend class LeafBurial;
    struct Place {
      glm::dvec2 texel;
      std::uint32_t triangle;  ///< kNone: the leaf is not covered there
      std::size_t part = 0;    ///< which of its pieces
      std::uint16_t number = 0;
      Answer answer = Answer::kNone;
      bool is_asked = false;  ///< not taken from those around
    };
    struct Part {
      std::uint32_t samples = 0, buried = 0;
    };
    std::vector<Place> places, asked_before;
    std::vector<Part> parts;
    std::vector<std::uint8_t> beside;  ///< places whose neighbours have not been looked at
    SolidParts::Around around;         ///< the leaf
  };

  /// All are to outlive it. `pieces`: sorted by leaf.
  LeafBurial(const PatchScene& patches, const std::vector<LeafPiece>& pieces, const Solids& solids,
             const Coincidence& coincidence);

  [[nodiscard]] std::uint32_t leafOf(const Contact& contact) const {
    const Surface& surface = patches_.surfaces[contact.surface];
    return surface.first_leaf + contact.y * surface.width + contact.x;
  }
  [[nodiscard]] std::uint32_t nodeOf(const Contact& contact) const {
    const Surface& surface = patches_.surfaces[contact.surface];
    return surface.first_node[contact.side] + contact.y * surface.width + contact.x;
  }
  /// The pieces of a leaf that no single triangle covers: [first, end).
  struct Pieces {
    std::size_t first, end;
  };
  [[nodiscard]] Pieces piecesOf(std::uint32_t leaf) const { return {first_piece_[leaf], first_piece_[leaf + 1]}; }

  /// Whether a place is inside a solid, or under a face that lies on it.
  [[nodiscard]] Solids::Answer ask(std::uint32_t triangle, const glm::dvec2& texel, std::uint32_t side,
                                   Hits& hits) const;

  /// Visible area of a leaf, as `count` places of it tell, and BurialPlaces::many where these do not agree; none where
  /// all of it is visible. Hits::gave_up: places took too much work.
  [[nodiscard]] std::optional<BuriedPart> measure(const Contact& contact, std::uint32_t count, const BurialPlaces& all,
                                                  Scratch& scratch) const;

 private:
  using Place = Scratch::Place;
  struct Outcome {
    std::uint32_t samples = 0, buried = 0;
    double visible_area = 0.0;

    [[nodiscard]] bool isMixed() const { return buried > 0 && buried < samples; }
  };
  [[nodiscard]] glm::vec3 facing(std::uint32_t triangle, std::uint32_t side) const {
    const glm::vec3& n = patches_.triangles[triangle].normal;
    return side == 0 ? n : -n;
  }
  [[nodiscard]] bool isBuried(std::uint32_t triangle, const glm::dvec2& texel, std::uint32_t side,
                              Scratch& scratch) const;
  /// Around all of a leaf, wherever it is covered.
  struct Extent {
    Bounds box;
    glm::vec3 normal;     ///< where the leaf is bent, of some part of it
    bool is_flat = true;  ///< it has one normal
    float height = 0.0F;  ///< along that, of its lowest place
  };
  [[nodiscard]] Extent extentOf(const Contact& contact, const Pieces& pieces) const;
  [[nodiscard]] bool isOpen(const Contact& contact, const Extent& extent, Scratch& scratch) const;
  void askPlaces(const Contact& contact, const Pieces& pieces, std::uint32_t count, Scratch& scratch) const;
  void askFiner(const Contact& contact, const Pieces& pieces, Scratch& scratch) const;
  [[nodiscard]] static bool mayBeStrip(const Scratch& scratch);
  [[nodiscard]] static Answer inferred(std::uint32_t finer, const Scratch& scratch);
  [[nodiscard]] Place placeOn(const Contact& contact, const Pieces& pieces, std::uint32_t number,
                              std::uint32_t count) const;
  void answer(const Contact& contact, Place& place, Scratch& scratch) const;
  [[nodiscard]] Outcome sumParts(const Contact& contact, const Pieces& pieces, Scratch& scratch) const;
  [[nodiscard]] BuriedPart takePart(const Contact& contact, const Outcome& outcome, const Scratch& scratch) const;

  const PatchScene& patches_;
  const std::vector<LeafPiece>& pieces_;
  const Solids& solids_;
  const Coincidence& coincidence_;
  std::vector<std::size_t> first_piece_;  ///< by leaf
};

}  // namespace radiosity::scene
