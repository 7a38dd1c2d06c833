#include "client/engines/export.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <utility>

#include "client/engines/baked_materials.h"
#include "client/engines/baked_nodes.h"
#include "client/engines/encode.h"
#include "client/engines/engine_files.h"
#include "client/engines/gltf_json.h"

namespace radiosity::engines {
namespace {

std::string_view endingOf(Encoding encoding) {
  switch (encoding) {
    case Encoding::kHalfExr:
    case Encoding::kPlainHalfExr:
      return "exr";
    case Encoding::kHalfDds:
      return "dds";
  }
  return "";
}

/// What luminances are multiplied by for a picture: light of the mean illuminance on a grey of 18 % comes to 0.18.
double exposureOf(const std::vector<Image>& pages) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& page : pages) {
    for (const auto& h : page.pixels) {
      const double lux = 0.2126 * double{h.r} + 0.7152 * double{h.g} + 0.0722 * double{h.b};
      if (!(lux > 0.0) || !std::isfinite(lux)) continue;
      sum += lux;
      ++count;
    }
  }
  return count > 0 ? std::numbers::pi * static_cast<double>(count) / sum : 1.0;
}

float largestOf(const std::vector<Image>& pages) {
  float largest = 0.0F;
  for (const auto& page : pages)
    for (const auto& h : page.pixels)
      for (int c = 0; c < 3; ++c)
        if (std::isfinite(h[c])) largest = std::max(largest, h[c]);
  return largest;
}

Json numberOrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

/// Encodes pages and tells what comes of it.
class Export {
 public:
  Export(const Engine& engine, LitScene scene) : engine_(engine), scene_(std::move(scene)) {}

  Result<Exported> run(const StatedError& error) {
    takeHiddenOut(scene_.gltf);
    const auto lamps = takeLightsOut(scene_.gltf);
    splitMaterialsByPage(scene_.gltf, scene_.pages.size());
    keepDiffuseOnly(scene_.gltf);
    takeDeadChannelsOut(scene_.gltf);
    trimExtensionLists(scene_.gltf);
    exported_.baked = lamps.size();
    if (auto done = addPages(); !done) return tl::unexpected(done.error());
    exported_.loss = square_ > 0.0 ? std::sqrt(square_loss_ / square_) : 0.0;
    auto glb = writeGlb(scene_.gltf, scene_.bin);
    if (!glb) return tl::unexpected(glb.error());
    add("scene.glb", std::move(*glb));
    addText("lighting.json", about(lamps, error).dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
    const std::string folder = std::string(engine_.name) + "/";
    for (const auto& file : allEngineFiles())
      if (file.name.starts_with(folder)) addText(std::string(file.name.substr(folder.size())), file.bytes);
    return std::move(exported_);
  }

 private:
  Result<void> addPages() {
    // PlayCanvas has no factor for a lightmap: all pages have one unit.
    const double unit = engine_.encoding == Encoding::kHalfDds ? unitFor(largestOf(scene_.pages)) : 0.0;
    for (std::size_t page = 0; page < scene_.pages.size(); ++page) {
      auto encoded = encodePage(scene_.pages[page], engine_.encoding, unit);
      if (!encoded) return tl::unexpected(encoded.error());
      square_loss_ += encoded->square_loss;
      square_ += encoded->square;
      Json entry = {{"width", scene_.pages[page].width},
                    {"height", scene_.pages[page].height},
                    {"encoding", encodingText(engine_.encoding)},
                    {"luxOfOne", encoded->unit}};
      auto name = "lightmap." + std::to_string(page) + "." + std::string(endingOf(engine_.encoding));
      entry["file"] = name;
      add(std::move(name), std::move(encoded->bytes));
      pages_.push_back(std::move(entry));
    }
    return {};
  }

  [[nodiscard]] Json about(const std::vector<std::string>& lamps, const StatedError& error) const {
    return {{"generator", "radiosity"},
            {"engine", engine_.name},
            {"scene", "scene.glb"},
            {"quantity", "irradiance, lux"},
            {"lightmaps", pages_},
            {"exposure", exposureOf(scene_.pages)},
            {"error",
             {{"total", numberOrNull(error.total)}, {"p95", numberOrNull(error.p95)}, {"encoding", exported_.loss}}},
            {"bakedLights", lamps}};
  }

  void add(std::string name, Bytes bytes) { exported_.files.push_back({std::move(name), std::move(bytes)}); }
  void addText(std::string name, std::string_view text) { add(std::move(name), Bytes(text.begin(), text.end())); }

  const Engine& engine_;
  LitScene scene_;
  Exported exported_;
  Json pages_ = Json::array();
  double square_loss_ = 0.0, square_ = 0.0;
};

}  // namespace

Result<Exported> exportFor(const Engine& engine, LitScene scene, const StatedError& error) {
  return Export(engine, std::move(scene)).run(error);
}

}  // namespace radiosity::engines
