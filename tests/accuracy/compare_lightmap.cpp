// compare_lightmap LIT.glb: how far a solved lightmap is from a path-traced reference.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/accuracy/compare.h"

namespace {

void print(const char* name, const radiosity::oracle::ErrorMetrics& m) {
  std::printf(
      "%-13s RMS %6.2f %%  median %6.2f %%  mean %6.2f %%  p99 %7.2f %%  bias %+6.2f %%  (%zu, reference +-%.2f %%)\n",
      name, 100 * m.solverRms(), 100 * m.median, 100 * m.mean, 100 * m.p99, 100 * m.bias, m.count,
      100 * m.reference_noise);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Compares a lit GLB and its EXR lightmaps with an independent path tracer."};
  std::string file;
  radiosity::accuracy::ReferenceOptions options;
  bool json = false;
  app.add_option("LIT.glb", file, "output of `radiosity solve`")->required()->check(CLI::ExistingFile);
  app.add_option("--reference-samples", options.texel_samples, "paths for each texel and point")->capture_default_str();
  app.add_option("--texels", options.texels, "texels to compare, drawn at random; 0: all")->capture_default_str();
  app.add_option("--points", options.points, "surface points for the total error")->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  app.add_flag("--json", json, "print JSON");
  CLI11_PARSE(app, argc, argv);
  options.point_samples = options.texel_samples;
  try {
    const auto lit = radiosity::accuracy::readLitScene(file);
    const auto reference = radiosity::accuracy::makeReference(lit, options);
    const auto accuracy = radiosity::accuracy::measure(lit, reference);
    if (json) {
      const nlohmann::json out{{"solver", radiosity::accuracy::toJson(accuracy.solver)},
                               {"total", radiosity::accuracy::toJson(accuracy.total)},
                               {"reference_seconds", reference.seconds},
                               {"warnings", lit.scene.warnings}};
      std::printf("%s\n", out.dump(2).c_str());
      return 0;
    }
    for (const auto& warning : lit.scene.warnings) std::printf("note: %s\n", warning.c_str());
    print("solver error", accuracy.solver);
    print("total error", accuracy.total);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "compare_lightmap: %s\n", error.what());
    return 1;
  }
  return 0;
}
