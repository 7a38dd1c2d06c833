// What links may still take of the memory that is theirs. Whoever plans measurements takes from it what their links can
// come to at most, so that the bound holds whatever the hemicubes find. Owned by LinkedSolver; one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/archive.h"
#include "server/solver/links/link_system.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/side.h"

namespace radiosity::solver {

class LinkMemory {
 public:
  /// `bytes`: what of SolverSettings::link_memory rays leave.
  LinkMemory(const scene::PatchScene& patches, const std::vector<Side>& sides, std::size_t bytes);

  /// Bytes that a column of links can come to take: two for each leaf of the sides that can be seen from there. Those
  /// of a planar side are in front of it; a curved one may see all. Cost: O(sides), for a side only the first time.
  [[nodiscard]] std::size_t mostBytes(std::uint32_t side);
  [[nodiscard]] std::size_t mostBytes(const LightPolygon& light) const;
  /// Finds out mostBytes() of many sides in one go, which takes a fraction of the time of one after the other.
  void learn(std::vector<std::uint32_t> sides);
  /// The same from anywhere.
  [[nodiscard]] std::size_t mostBytes() const { return all_bytes_; }

  /// A plan begins: what `system` has is taken. Its rows must be up to date.
  void begin(const LinkSystem& system);
  /// A new shooter of a node, with a column in as many halves as said. False: there is no room. It leaves some for the
  /// samples of those that are there.
  [[nodiscard]] bool takeShooter(const Shooter& shooter, std::size_t columns, const LinkSystem& system);
  /// A sample in a half of a shooter that is there.
  [[nodiscard]] bool takeSample(const Shooter& shooter, std::size_t half);

  /// Links that were counted by begin() are forgotten.
  void giveBack(std::size_t bytes) { taken_ -= bytes; }

  /// More is taken than there is: an edit made the equation larger.
  [[nodiscard]] bool isOverdrawn() const { return taken_ > bytes_; }

  /// Whether the equation, for the materials that there are now, takes more than half of the memory.
  [[nodiscard]] bool isMostlyRows(const LinkSystem& system) const;

  /// A shooter was refused since forgive().
  [[nodiscard]] bool isFull() const { return full_; }
  /// Shooters may be asked for again: light, or what there is, has changed.
  void forgive() { full_ = false; }
  /// A sample was refused since begin().
  [[nodiscard]] bool lacksSamples() const { return lacks_samples_; }

  /// Between two plans.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.full_, self.lacks_samples_);
  }

 private:
  /// Where one looks from: a plane, and a box around what is in it.
  struct View {
    glm::vec3 point, normal, low, high;
  };

  template <typename Sees>
  [[nodiscard]] std::size_t bytesOfSides(Sees sees) const;
  [[nodiscard]] View viewFrom(std::uint32_t side) const;
  void addBytes(std::span<const View> views, std::span<const Side> receivers, std::span<std::size_t> bytes) const;
  [[nodiscard]] bool canReach(const View& from, const Side& receiver) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  std::size_t bytes_;
  std::size_t all_bytes_ = 0;
  std::vector<std::size_t> side_bytes_;  // 0: not known yet
  std::size_t taken_ = 0, rows_ = 0, shooters_ = 0;
  bool full_ = false, lacks_samples_ = false;
};

}  // namespace radiosity::solver
