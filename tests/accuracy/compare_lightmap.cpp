// compare_lightmap LIT.glb [SCENE.glb]: how far a solved lightmap is from a path-traced reference.
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

void print(const radiosity::accuracy::SurfaceError& e) {
  std::printf(
      "%-13s RMS %6.2f %%  median %6.2f %%  p95 %6.2f %%  p99 %7.2f %%  mean ratio %.4f  leaks %zu, in the open %zu  "
      "(%zu "
      "points of %zu, reference +-%.2f %%)\n",
      "at the surface", 100 * e.rms(), 100 * e.median, 100 * e.p95, 100 * e.p99, e.mean_ratio, e.leaks, e.open_leaks,
      e.compared, e.points, 100 * e.reference_noise);
  if (const auto left_out = radiosity::accuracy::leftOutText(e); !left_out.empty())
    std::printf("  not in these figures, of the area: %s\n", left_out.c_str());
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
  std::map<std::tuple<int, int, int, bool>, radiosity::accuracy::Texel> places;
  for (auto& texel : radiosity::accuracy::findTexels(lit))
    places[{texel.page, texel.x, texel.y, texel.back}] = std::move(texel);
  for (std::size_t i = 0; i < std::min(count, entries.size()); ++i) {
    const auto& [texel, value, square] = entries[i];
    const auto& place = places.at({texel->page, texel->x, texel->y, texel->back});
    const auto at = place.footprint.pieces.front().corners[0];
    const auto error = glm::abs(value - texel->irradiance.mean_lux);
    const int c = error.x > error.y && error.x > error.z ? 0 : error.y > error.z ? 1 : 2;
    std::printf(
        "%4.1f %% page %d (%d, %d), \"%s\" at (%.3g, %.3g, %.3g): %.5g lux for %.5g +-%.2g (%s), %.0f %% visible%s\n",
        100 * square / sum, texel->page, texel->x, texel->y, lit.scene.node_names.at(place.node).c_str(), at.x, at.y,
        at.z, value[c], texel->irradiance.mean_lux[c], texel->irradiance.standard_error[c],
        std::array{"red", "green", "blue"}[static_cast<std::size_t>(c)], 100 * texel->irradiance.visible_fraction,
        texel->decided() ? (texel->back ? ", from behind" : "") : ", not decided");
  }
}

/// Without light nothing can be wrong, and every lightmap would pass.
void requireLight(const radiosity::accuracy::Reference& reference) {
  const auto isLit = [](const auto& place) { return glm::length(place.irradiance.mean_lux) > 0.0; };
  if (!std::any_of(reference.texels.begin(), reference.texels.end(), isLit) &&
      !std::any_of(reference.points.begin(), reference.points.end(), isLit))
    throw std::runtime_error("no light reaches the texels and points of the reference; was there a --sky?");
}

struct Options {
  std::string file, unlit, sky, folder;
  radiosity::accuracy::ReferenceOptions reference;
  bool json = false, points_only = false;
  std::size_t worst = 0;
};

radiosity::accuracy::Reference referenceFor(const radiosity::accuracy::LitScene& lit, const Options& options) {
  namespace accuracy = radiosity::accuracy;
  const auto part = [&](accuracy::ReferencePart which) {
    return options.folder.empty() ? accuracy::makePart(lit, options.reference, which)
                                  : accuracy::findPart(lit, options.reference, which, options.folder).reference;
  };
  auto points = part(accuracy::ReferencePart::kPoints);
  return options.points_only ? points : accuracy::join(part(accuracy::ReferencePart::kTexels), std::move(points));
}

void printJson(const radiosity::accuracy::LitScene& lit, const radiosity::accuracy::Reference& reference) {
  namespace accuracy = radiosity::accuracy;
  const auto measured = accuracy::measure(lit, reference);
  nlohmann::json out{{"surface", accuracy::toJson(measured.surface)},
                     {"total", accuracy::toJson(measured.total)},
                     {"reference_seconds", reference.seconds},
                     {"warnings", lit.traced().warnings}};
  if (!reference.texels.empty()) {
    const auto decided = accuracy::measureTexels(lit.pages, reference, accuracy::TexelChoice::kDecided);
    out["solver"] = accuracy::toJson(measured.solver);
    out["solver_decided"] = accuracy::toJson(decided);
    out["undecided_area"] = accuracy::undecidedArea(reference);
    out["cut_area"] = reference.cut_area;
    out["hidden_area"] = reference.hidden_area;
  }
  std::printf("%s\n", out.dump(2).c_str());
}

void printText(const radiosity::accuracy::LitScene& lit, const radiosity::accuracy::Reference& reference) {
  namespace accuracy = radiosity::accuracy;
  for (const auto& warning : lit.traced().warnings) std::printf("note: %s\n", warning.c_str());
  const auto measured = accuracy::measure(lit, reference);
  print(measured.surface);
  print("total error", measured.total);
  if (reference.texels.empty()) return;
  print("solver error", measured.solver);
  if (const double undecided = accuracy::undecidedArea(reference); undecided > 0.0) {
    print("  decided", accuracy::measureTexels(lit.pages, reference, accuracy::TexelChoice::kDecided));
    std::printf(
        "%.1f %% of the area is not decided: models are so open there that rays disagree about what is inside\n",
        100 * undecided);
  }
  std::printf("  not in the solver error, of the texels' area: cut by an edge %.1f %%, hidden %.1f %%\n",
              100 * reference.cut_area, 100 * reference.hidden_area);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Compares a lit GLB and its EXR lightmaps with an independent path tracer: lookups at points of the surface, and "
      "means of whole texels."};
  Options options;
  auto& reference = options.reference;
  app.add_option("LIT.glb", options.file, "output of `radiosity solve`")->required()->check(CLI::ExistingFile);
  app.add_option("SCENE.glb", options.unlit, "what was lit, .glb or .gltf: light is traced in it; else in LIT.glb")
      ->check(CLI::ExistingFile);
  app.add_option("--reference-samples", reference.texel_samples, "paths for each texel and point")
      ->capture_default_str();
  app.add_option("--texels", reference.texels, "texels to compare, drawn at random; 0: all")->capture_default_str();
  app.add_option("--points", reference.points, "surface points to look up")->capture_default_str();
  app.add_flag("--points-only", options.points_only, "leave texels out");
  app.add_option("--seed", reference.seed)->capture_default_str();
  app.add_flag("--closed-form", reference.closed_form, "take the exact value, without noise, where the scene has one");
  app.add_option("--sky", options.sky,
                 "the sky it was solved under, as `radiosity solve` takes it; a scene's own comes first");
  app.add_flag("--json", options.json, "print JSON");
  app.add_option("--worst", options.worst, "show the texels with most of the squared error");
  app.add_option("--references", options.folder, "folder where references are kept between runs; empty: not kept");
  CLI11_PARSE(app, argc, argv);
  reference.point_samples = reference.texel_samples;
  try {
    auto lit = options.unlit.empty() ? radiosity::accuracy::readLitScene(options.file)
                                     : radiosity::accuracy::readLitScene(options.file, options.unlit);
    if (!options.sky.empty()) radiosity::accuracy::setSky(options.sky, lit);
    const auto made = referenceFor(lit, options);
    requireLight(made);
    if (options.json) {
      printJson(lit, made);
    } else {
      printText(lit, made);
      if (options.worst > 0 && !made.texels.empty()) printWorst(lit, made, options.worst);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compare_lightmap: %s\n", error.what());
    return 1;
  }
  return 0;
}
