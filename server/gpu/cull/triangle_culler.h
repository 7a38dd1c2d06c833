// Decides on the CPU which triangles each hemicube face must draw: far cheaper than the driver finds out the same. The
// image is that of all triangles, pixel by pixel; nothing is left out that a sample of it could show. One thread.
//
// Left out are, in this order: clusters and triangles at or below the shooter's plane, or outside the face; backs of
// closed solids that do not hold the shooter; triangles that lie between the sample points of the pixels; and, in large
// scenes, what lies behind other triangles. For this the large and near ones are drawn first; the depth of their image
// then hides whole clusters (Greene, Kass and Miller 1993, as practised since Haar and Aaltonen 2015).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "server/gpu/cull/hemicube_views.h"
#include "server/gpu/cull/triangle_clusters.h"
#include "server/gpu/cull/view_window.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

/// Which skips are in force; all but for tests and benchmarks that show what each saves.
struct Culling {
  bool faces = true;    ///< outside a face, below the plane
  bool backs = true;    ///< backs of closed solids
  bool samples = true;  ///< between sample points
  bool hidden = true;   ///< behind others
};

class TriangleCuller {
 public:
  TriangleCuller() = default;
  explicit TriangleCuller(const scene::PatchScene& patches, const Culling& culling = {});

  /// A draw list of one face: corners of triangles that lie wholly inside its pyramid, or of those that cross its
  /// border. They are drawn apart: llvmpipe takes a slow path for a whole draw as soon as one of its triangles must be
  /// clipped.
  struct List {
    std::vector<std::uint32_t> indices;  ///< of which `count` are valid
    std::uint32_t count = 0;
    struct Run {
      std::uint32_t cluster, end;  ///< into `indices`
    };
    std::vector<Run> runs;  ///< of those that may be hidden

    [[nodiscard]] std::span<const std::uint32_t> valid() const { return {indices.data(), count}; }
  };
  using Lists = std::array<List, std::size_t{2} * RAD_FACES>;  ///< face f: 2 f inside, 2 f + 1 crossing
  struct Selection {
    Lists first;                ///< to be drawn at once
    Lists second;               ///< to be drawn if they are not hidden by the first
    std::uint32_t between = 0;  ///< triangles left out since they show no sample, summed over faces
  };

  /// `selection` is overwritten.
  /// With a window, only what may be seen through it.
  void select(const solver::HemicubeFrame& frame, std::uint32_t resolution, Selection& selection,
              const ViewWindow* window = nullptr);

  /// Takes from the second lists what the depth image of the first hides (layout of hemicube_weights.h, RAD_NEAR /
  /// distance along the face's axis). Returns the triangles taken out.
  std::uint32_t takeHidden(const solver::HemicubeFrame& frame, std::uint32_t resolution, std::span<const float> depth,
                           Selection& selection) const;

  /// Whether a triangle's back is hidden from the last shooter by the rest of its solid.
  [[nodiscard]] bool backHidden(std::size_t triangle) const {
    return solids_.solid_of[triangle] != scene::kNone && outside_[solids_.solid_of[triangle]] != 0;
  }
  [[nodiscard]] std::size_t triangleCount() const { return clusters_.order.size(); }

 private:
  void emit(const TriangleClusters::Cluster& cluster, std::uint32_t number, std::uint32_t faces, bool near,
            Selection& selection);

  Culling culling_;
  TriangleClusters clusters_;
  // By place in the clusters' order:
  std::array<std::array<std::vector<float>, 3>, 3> corner_;  ///< [corner][axis]
  std::array<std::vector<float>, 4> plane_;                  ///< normal, distance
  std::vector<float> area_;
  std::vector<std::uint32_t> solid_, indices_;
  std::vector<std::uint32_t> seen_;  ///< bits of what classify() found
  scene::ClosedSolids solids_;
  std::vector<std::uint8_t> outside_;  ///< by solid: the shooter is
};

}  // namespace radiosity::gpu
