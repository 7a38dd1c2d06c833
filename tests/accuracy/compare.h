// A solved lightmap against the path tracer, two ways. What people see, and what counts: lookups at random points of
// the surface (surface.h). And to find causes the solver error: the mean irradiance of whole texels.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tests/accuracy/lit_scene.h"
#include "tests/accuracy/surface.h"
#include "tests/oracle/error_metrics.h"

namespace radiosity::accuracy {

struct ReferenceOptions {
  std::uint32_t texel_samples = 1024;  ///< paths a texel
  std::uint32_t point_samples = 1024;  ///< paths a point
  std::size_t texels = 4000;           ///< drawn at random among the whole ones; 0: all
  std::size_t points = 2000;           ///< drawn by area, over all that there is
  std::uint64_t seed = 1;
  bool closed_form = false;  ///< take the exact value, without noise, where the scene has one (closed_form.h)
};

/// What the path tracer says of texels, which depends on their layout, and of points, which does not.
struct Reference {
  /// Of one side of a surface: where two share a texel each has a mean of its own, and the texel one value.
  struct TexelMean {
    int page = 0, x = 0, y = 0;
    bool back = false;
    double area = 0.0;  ///< visible, m^2
    /// Wholly visible, one-sided, and reflecting in every channel. Other bakers agree with us on what the value of such
    /// a texel is: they average over buried parts too, and derive irradiance from reflected light.
    bool plain = false;
    oracle::Irradiance irradiance;

    /// No more than a hundredth of it lies where models are so open that rays disagree about whether it is inside.
    [[nodiscard]] bool decided() const { return irradiance.undecided_fraction <= 0.01; }
  };
  using Point = SurfacePoint;
  std::vector<TexelMean> texels;
  std::vector<Point> points;
  /// Of the area of all texels, what no solver error is stated of: texels that an edge cuts, and those of which less
  /// than a quarter is visible.
  double cut_area = 0.0, hidden_area = 0.0;
  double seconds = 0.0;  ///< that it took
  bool exact = false;    ///< not traced but known
};

enum class ReferencePart { kTexels, kPoints };
[[nodiscard]] Reference makePart(const LitScene& lit, const ReferenceOptions& options, ReferencePart part);
[[nodiscard]] Reference makeReference(const LitScene& lit, const ReferenceOptions& options);
/// Texels of one, points of the other.
[[nodiscard]] Reference join(Reference texels, Reference points);

struct Accuracy {
  SurfaceError surface;
  oracle::ErrorMetrics solver, total;  ///< total: of SurfaceComparison
};

/// `lit` must have the layout that the reference was made for.
[[nodiscard]] Accuracy measure(const LitScene& lit, const Reference& reference);

enum class TexelChoice { kAll, kDecided, kPlain };

/// The solver error of measure(), for pages in the layout that the reference was made for.
[[nodiscard]] oracle::ErrorMetrics measureTexels(const std::vector<Page>& pages, const Reference& reference,
                                                 TexelChoice choice);

/// Of the area of the reference's texels, those for which it has no answer how much of them is visible.
[[nodiscard]] double undecidedArea(const Reference& reference);

[[nodiscard]] nlohmann::json toJson(const oracle::ErrorMetrics& metrics);

}  // namespace radiosity::accuracy
