// compare_lightmap LIT.glb: how far a solved lightmap is from a path-traced reference.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <glm/geometric.hpp>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/reference_store.h"
#include "tests/accuracy/solve_run.h"

namespace {

void print(const char* name, const radiosity::oracle::ErrorMetrics& m) {
  const auto [low, high] = m.solverRange();
  std::printf(
      "%-13s RMS %6.2f %% (%.2f to %.2f)  median %6.2f %%  mean %6.2f %%  p99 %7.2f %%  bias %+6.2f %%  (%zu, "
      "reference "
      "+-%.2f %%)\n",
      name, 100 * m.solverRms(), 100 * low, 100 * high, 100 * m.median, 100 * m.mean, 100 * m.p99, 100 * m.bias,
      m.count, 100 * m.reference_noise);
}

/// Where the squared error sits: how much of it in texels that are partly buried or otherwise special, and the texels
/// that hold most of it.
void printWorst(const radiosity::accuracy::LitScene& lit, const radiosity::accuracy::Reference& reference,
                std::size_t count) {
  struct Entry {
    const radiosity::accuracy::Reference::TexelMean* texel;
    glm::dvec3 value;
    double square;
  };
  std::vector<Entry> entries;
  double sum = 0.0, plain = 0.0, area = 0.0, plain_area = 0.0;
  for (const auto& texel : reference.texels) {
    const auto value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    const auto error = value - texel.irradiance.mean_lux, noise = texel.irradiance.standard_error;
    entries.push_back({&texel, value, texel.area * (glm::dot(error, error) - glm::dot(noise, noise))});
    sum += entries.back().square;
    area += texel.area;
    if (texel.plain) plain += entries.back().square, plain_area += texel.area;
  }
  std::printf("wholly visible, one-sided texels: %.1f %% of the area, %.1f %% of the squared error\n",
              100 * plain_area / area, 100 * plain / sum);
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.square > b.square; });
  std::map<std::tuple<int, int, int>, radiosity::accuracy::Texel> places;
  for (auto& texel : radiosity::accuracy::findTexels(lit)) places[{texel.page, texel.x, texel.y}] = std::move(texel);
  for (std::size_t i = 0; i < std::min(count, entries.size()); ++i) {
    const auto& [texel, value, square] = entries[i];
    const auto& place = places.at({texel->page, texel->x, texel->y});
    const auto at = place.footprint.pieces.front().corners[0];
    const auto error = glm::abs(value - texel->irradiance.mean_lux);
    const int c = error.x > error.y && error.x > error.z ? 0 : error.y > error.z ? 1 : 2;
    std::printf(
        "%4.1f %% page %d (%d, %d), \"%s\" at (%.3g, %.3g, %.3g): %.5g lux for %.5g +-%.2g (%s), %.0f %% visible%s\n",
        100 * square / sum, texel->page, texel->x, texel->y, lit.scene.node_names.at(place.node).c_str(), at.x, at.y,
        at.z, value[c], texel->irradiance.mean_lux[c], texel->irradiance.standard_error[c],
        std::array{"red", "green", "blue"}[static_cast<std::size_t>(c)], 100 * texel->irradiance.visible_fraction,
        texel->decided() ? "" : ", not decided");
  }
}

/// Without light nothing can be wrong, and every lightmap would pass.
void requireLight(const radiosity::accuracy::Reference& reference) {
  const auto isLit = [](const radiosity::accuracy::Reference::TexelMean& texel) {
    return glm::length(texel.irradiance.mean_lux) > 0.0;
  };
  if (!std::any_of(reference.texels.begin(), reference.texels.end(), isLit))
    throw std::runtime_error("no light reaches the texels of the reference; was there a --sky?");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Compares a lit GLB and its EXR lightmaps with an independent path tracer."};
  std::string file;
  radiosity::accuracy::ReferenceOptions options;
  bool json = false;
  std::string sky;
  std::size_t worst = 0;
  std::string folder;
  app.add_option("LIT.glb", file, "output of `radiosity solve`")->required()->check(CLI::ExistingFile);
  app.add_option("--reference-samples", options.texel_samples, "paths for each texel and point")->capture_default_str();
  app.add_option("--texels", options.texels, "texels to compare, drawn at random; 0: all")->capture_default_str();
  app.add_option("--points", options.points, "surface points for the total error")->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  app.add_flag("--closed-form", options.closed_form, "take the exact value, without noise, where the scene has one");
  app.add_option("--sky", sky, "the sky it was solved under, as `radiosity solve` takes it; a scene's own comes first");
  app.add_flag("--json", json, "print JSON");
  app.add_option("--worst", worst, "show the texels with most of the squared error");
  app.add_option("--references", folder, "folder where references are kept between runs; empty: not kept");
  CLI11_PARSE(app, argc, argv);
  options.point_samples = options.texel_samples;
  try {
    auto lit = radiosity::accuracy::readLitScene(file);
    if (!sky.empty()) radiosity::accuracy::setSky(sky, lit);
    const auto reference = folder.empty() ? radiosity::accuracy::makeReference(lit, options)
                                          : radiosity::accuracy::findReference(lit, options, folder).reference;
    requireLight(reference);
    const auto accuracy = radiosity::accuracy::measure(lit, reference);
    const auto decided =
        radiosity::accuracy::measureTexels(lit.pages, reference, radiosity::accuracy::TexelChoice::kDecided);
    const double undecided = radiosity::accuracy::undecidedArea(reference);
    if (json) {
      const nlohmann::json out{{"solver", radiosity::accuracy::toJson(accuracy.solver)},
                               {"solver_decided", radiosity::accuracy::toJson(decided)},
                               {"undecided_area", undecided},
                               {"total", radiosity::accuracy::toJson(accuracy.total)},
                               {"reference_seconds", reference.seconds},
                               {"warnings", lit.scene.warnings}};
      std::printf("%s\n", out.dump(2).c_str());
      return 0;
    }
    for (const auto& warning : lit.scene.warnings) std::printf("note: %s\n", warning.c_str());
    print("solver error", accuracy.solver);
    if (undecided > 0.0) {
      print("  decided", decided);
      std::printf(
          "%.1f %% of the area is not decided: models are so open there that rays disagree about what is inside\n",
          100 * undecided);
    }
    print("total error", accuracy.total);
    if (worst > 0) printWorst(lit, reference, worst);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compare_lightmap: %s\n", error.what());
    return 1;
  }
  return 0;
}
