// A stage of the gathered solve: light that varies within leaves, of which links and rays know nothing. It traces paths
// once little else is in error (LeafVariation), keeps what they tell up to date with the light, and traces more where
// they lower the error most. Owned by LinkedSolver; one thread outside of the calls.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "server/solver/edits/shadows.h"
#include "server/solver/variation/leaf_variation.h"

namespace radiosity::solver {

class VariationStage {
 public:
  /// Makes them when they are asked for first.
  using RaysOf = std::function<std::shared_ptr<const LeafRays>()>;
  /// The first two are to outlive it. No path is traced yet.
  VariationStage(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed, RaysOf rays)
      : patches_(patches), sides_(sides), seed_(seed), rays_(std::move(rays)) {}

  /// Whether paths were traced: else it says nothing, and corrects nothing.
  [[nodiscard]] bool isTraced() const { return paths_ != nullptr; }
  /// Whether advance() is on its way.
  [[nodiscard]] bool isTracing() const { return is_tracing_; }
  void stopTracing() { is_tracing_ = false; }
  /// Traces the first paths, or what an edit of geometry left to trace, for about so many seconds. What varies is
  /// looked into down to a part of `aim`, a relative error. False: to be called again, with the same light.
  [[nodiscard]] bool advance(const LeafLight& light, double aim, double seconds);
  /// Brings what paths tell up to date with the light.
  void update(const LeafLight& light, double aim);
  /// More paths, where these would lower an error of so much by more than anything else would; update() is to follow.
  [[nodiscard]] bool refine(double total_error);
  /// Paths are of no use here.
  void forget();

  // Squares of irradiance (lux) times area, as of LeafVariation. Where isTraced().
  [[nodiscard]] double noise() const { return paths_->noise(); }
  [[nodiscard]] double left() const { return paths_->left(); }
  /// None where no paths were traced.
  [[nodiscard]] std::span<const LeafVariation::Correction> corrections() const;

  /// Of the scene before an edit of geometry: where a leaf's number was `value_before` (kNone: it is new, or altered),
  /// and nothing changed near it, what its paths meet is what they met. `same_lights`: those of before are `lights`.
  void inherit(const VariationStage& former, std::span<const std::uint32_t> value_before, const Shadows& shadows,
               bool same_lights, std::span<const LightPolygon> lights);

  void save(ArchiveWriter& to) const;
  /// False: what there is does not fit. update() is to follow where isTraced().
  [[nodiscard]] bool restore(ArchiveReader& from);

 private:
  [[nodiscard]] std::unique_ptr<LeafVariation> makePaths() const;
  [[nodiscard]] bool bringUpToDate(LeafVariation& paths, const LeafLight& light, double aim, double seconds);

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  std::uint64_t seed_;
  RaysOf rays_;
  std::unique_ptr<LeafVariation> paths_;       // null: not traced
  std::unique_ptr<LeafVariation> next_paths_;  // while they are traced
  bool is_tracing_ = false;
  double square_ = 0.0;  // of the light that they are up to date with, times area
};

}  // namespace radiosity::solver
