// After an edit of geometry: the links of the scene before that go over to the scene after, in its numbers, and which
// of them are to be repaired. Same shooters, same points, so that links are those that a fresh measurement of all would
// find. Lives while LinkedSolver is made; one thread outside of the calls.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/repair/edit_repair.h"

namespace radiosity::solver {

/// Keys of sides (Side::key, Side::triangle_key) from here on never were any side's.
struct KeyEnds {
  std::uint32_t node = 0, triangle = 0;
};

class LinkInheritance {
 public:
  /// The scene before. Without `is_kept` its links go as they are taken over, so that memory never holds them twice.
  struct Former {
    const LinkParts& parts;
    const EditRepair& repair;
    KeyEnds keys;
    bool is_kept;
  };
  /// The scene after, whose links these become. What `repair` says of shadows is to be set before take...().
  struct Successor {
    const LinkParts& parts;
    EditRepair& repair;
    std::vector<Side>& sides;           ///< of `parts`
    std::vector<LightPolygon>& lights;  ///< likewise; empty
  };
  /// Gives `after.sides` their keys: those that are still there keep theirs, others get keys that no side ever had. All
  /// that is referred to is to outlive it.
  LinkInheritance(const Former& before, const Successor& after, const scene::PatchMap& map);

  /// Keys given out so far, with those of the scene before.
  [[nodiscard]] KeyEnds keys() const { return keys_; }
  /// By side of the scene before: where it is now, or kNone.
  [[nodiscard]] const std::vector<std::uint32_t>& sideAfter() const { return side_after_; }
  [[nodiscard]] GeometryChange change() const;
  /// Adds the changes that edits before this one made, and which were not taken in.
  void addEarlier(GeometryChange& change) const;

  /// Light polygons that have not moved, dark ones too. Their emission is to be set.
  void takeLights();
  /// After the lights of the scene after are all there.
  void takeNodes();
  /// Of the matrix: rows of nodes that are what they were, and columns whose links went over as they are.
  void takeEntries() const;
  /// By leaf value: that before the edit, or kNone where the leaf is another, or elsewhere.
  [[nodiscard]] std::vector<std::uint32_t> unalteredBefore() const;

 private:
  void findSides(const scene::PatchMap& map);
  [[nodiscard]] bool isAltered(const NodePlace& place, const GeometryChange& change) const;
  void takeShooter(std::uint32_t old_index, std::uint32_t index, bool whole);
  void takeColumns(std::size_t first_repair) const;

  Former before_;
  Successor after_;
  const scene::PatchMap& map_;
  KeyEnds keys_;
  std::vector<std::uint32_t> side_after_;          // by old side; kNone: gone
  std::vector<std::uint32_t> unmoved_after_;       // the same; kNone also where it moved
  std::vector<std::array<Repair, 2>> unfinished_;  // by old shooter and half: what was still to be taken again
  std::vector<std::uint32_t> shooter_before_;      // by shooter; it may be shorter
};

}  // namespace radiosity::solver
