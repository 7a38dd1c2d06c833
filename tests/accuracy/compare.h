// A solved lightmap against the path tracer, two ways. Solver error: the mean irradiance of whole texels. Total error:
// a bilinear lookup at random points of the surface, so that the size of the texels counts too.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tests/accuracy/lit_scene.h"
#include "tests/oracle/error_metrics.h"

namespace radiosity::accuracy {

struct ReferenceOptions {
  std::uint32_t texel_samples = 1024;  ///< paths a texel
  std::uint32_t point_samples = 1024;  ///< paths a point
  std::size_t texels = 4000;           ///< drawn at random among the whole ones; 0: all
  std::size_t points = 2000;           ///< drawn by area
  std::uint64_t seed = 1;
  bool closed_form = false;  ///< take the exact value, without noise, where the scene has one (closed_form.h)
};

/// What the path tracer says for one layout of texels.
struct Reference {
  struct TexelMean {
    int page = 0, x = 0, y = 0;
    double area = 0.0;  ///< visible, m^2
    /// Wholly visible, one-sided, and reflecting in every channel. Other bakers agree with us on what the value of such
    /// a texel is: they average over buried parts too, and derive irradiance from reflected light.
    bool plain = false;
    oracle::Irradiance irradiance;

    /// No more than a hundredth of it lies where models are so open that rays disagree about whether it is inside.
    [[nodiscard]] bool decided() const { return irradiance.undecided_fraction <= 0.01; }
  };
  struct Point {
    int page = 0;
    glm::dvec2 uv{0.0};
    oracle::Irradiance irradiance;
  };
  std::vector<TexelMean> texels;
  std::vector<Point> points;
  double seconds = 0.0;  ///< that it took
  bool exact = false;    ///< not traced but known
};

[[nodiscard]] Reference makeReference(const LitScene& lit, const ReferenceOptions& options);

struct Accuracy {
  oracle::ErrorMetrics solver, total;
};

/// `lit` must have the layout that the reference was made for.
[[nodiscard]] Accuracy measure(const LitScene& lit, const Reference& reference);

enum class TexelChoice { kAll, kDecided, kPlain };

/// The first half of measure(), for pages in the layout that the reference was made for.
[[nodiscard]] oracle::ErrorMetrics measureTexels(const std::vector<Page>& pages, const Reference& reference,
                                                 TexelChoice choice);

/// Of the area of the reference's texels, those for which it has no answer how much of them is visible.
[[nodiscard]] double undecidedArea(const Reference& reference);

[[nodiscard]] nlohmann::json toJson(const oracle::ErrorMetrics& metrics);

}  // namespace radiosity::accuracy
