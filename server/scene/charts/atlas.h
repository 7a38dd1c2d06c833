// Texel grids of charts and their places on lightmap pages. Third step of buildPatchScene (charts.h).
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/charts/build.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {

/// texel = plane coordinate x texels_per_unit - offset.
struct ChartGrid {
  std::uint32_t width = 1, height = 1;
  glm::dvec2 texels_per_unit{1.0};
  glm::dvec2 offset{0.0};
  std::array<PagePlace, 2> place;  ///< front, back
};

struct Atlas {
  std::vector<ChartGrid> grids;  ///< one for each chart
  std::vector<Page> pages;
  PagePlace black;  ///< PatchScene::black
  std::vector<std::string> warnings;
};

/// Where charts were before an edit.
struct FormerPlaces {
  struct Place {
    std::array<PagePlace, 2> side;
    std::uint32_t width = 0, height = 0;  ///< width 0: it was not there
  };
  std::vector<Place> of_chart;  ///< empty: there was no scene before
  std::vector<Page> pages;
  PagePlace black;
};

/// The texel edge (unit box) at which about `texel_budget` leaves are covered.
[[nodiscard]] double texelSizeFor(const std::vector<Chart>& charts, std::uint64_t texel_budget);

/// Texels a unit of UV that a file's own layout of this extent gets. `texel`: of its instance, unit box; `density`: UV
/// lengths a unit-box length.
[[nodiscard]] double uvResolution(const glm::dvec2& extent, double texel, double density, const ChartOptions& options);

/// Grids for texels of about `texel_size`, packed with `options.gutter` empty texels between. Charts whose
/// grid is as it was keep their places, as long as half of the pages is in use. Charts that would not fit
/// a page get coarser texels, with a warning. kTooLarge: more than kMaxPages pages or mostLeaves()
/// leaves.
[[nodiscard]] Result<Atlas> layOut(const Scene& scene, const std::vector<Chart>& charts, double texel_size,
                                   const ChartOptions& options, const FormerPlaces& former = {});

inline constexpr std::size_t kMaxPages = 1024;
/// Those that three quarters of the memory hold with all that a solve needs; at most kMaxLeaves.
[[nodiscard]] std::uint64_t mostLeaves();

}  // namespace radiosity::scene
