#include "server/scene/import/image_plan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <queue>
#include <string>
#include <string_view>
#include <utility>

#include "server/scene/document/image_decode.h"
#include "server/scene/document/json_text.h"
#include "server/scene/document/scene_limit.h"
#include "server/scene/import/texture_references.h"

namespace radiosity::scene {
namespace {

/// All images together may have so many times what one may, not counting what their data makes likely: pixels of a
/// photograph take more than a bit, and what is smaller than that is mostly one colour.
constexpr std::uint64_t kTotalImages = 4, kLikelyPixelsAByte = 64;
/// While one is decoded: what the decoder holds, and its result.
constexpr std::uint64_t kDecodedBytes = 4, kDecoderBytes = 12;
/// Of pictures that are larger one decoder works at a time.
constexpr std::uint64_t kMostOfTwo = std::uint64_t{1} << 24;
/// Of a pixel: itself, and its mip levels while materials are shaded, which are kept for all pictures in turn.
constexpr std::uint64_t kShadedThirds = 28, kDecodedThirds = 3 * kDecodedBytes;

/// Textures that light needs.
constexpr std::array<std::string_view, 8> kUsed = {"baseColorTexture",           "emissiveTexture",
                                                   "metallicRoughnessTexture",   "diffuseTexture",
                                                   "specularGlossinessTexture",  "transmissionTexture",
                                                   "diffuseTransmissionTexture", "diffuseTransmissionColorTexture"};

/// An index of that many things; `count` where it is none.
std::size_t indexOf(const Json& value, std::size_t count) {
  if (!value.is_number_integer() || value.get<std::int64_t>() < 0) return count;
  return std::min(value.get<std::size_t>(), count);
}

/// How an image is used: as colours, as numbers, as a mask; what is used in two ways is held twice.
constexpr std::uint8_t kAsColours = 1, kAsNumbers = 2, kAsMask = 4;
std::uint8_t useOf(std::string_view key) {
  if (key == "transmissionTexture") return kAsMask;
  return key == "metallicRoughnessTexture" ? kAsNumbers : kAsColours;
}

/// Marks what a material uses. Values nest at most 64 deep.
void markUsed(const Json& value, const Json& textures, std::vector<std::uint8_t>& used) {
  if (!value.is_object()) return;
  for (const auto& [key, child] : value.items()) {
    if (key == "extras") continue;
    const auto index = child.is_object() ? child.find("index") : child.end();
    if (std::ranges::find(kUsed, key) != kUsed.end() && child.is_object() && index != child.end()) {
      const auto texture = indexOf(*index, textures.size());
      if (texture >= textures.size()) continue;
      if (const auto image = imageReferenceOf(textures[texture], used.size())) used[*image] |= useOf(key);
    } else {
      markUsed(child, textures, used);
    }
  }
}

std::vector<std::uint8_t> usedImages(const Document& document) {
  std::vector<std::uint8_t> used(document.images.size(), 0);
  const auto& gltf = document.gltf;
  if (!gltf.contains("materials") || !gltf.contains("textures")) return used;
  for (const auto& material : gltf["materials"]) markUsed(material, gltf["textures"], used);
  return used;
}

/// Halves the largest until all take no more than they may.
void halveLargest(const std::vector<ImageSize>& sizes, const std::vector<std::uint8_t>& used, std::uint64_t most,
                  ImagePlan& plan) {
  std::priority_queue<std::pair<std::uint64_t, std::size_t>> largest;
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (sizes[i].pixels() > 0) largest.emplace(sizes[i].pixels(), i);
  while (plan.bytes > most && !largest.empty() && largest.top().first > 1) {
    const auto [pixels, image] = largest.top();
    largest.pop();
    plan.halved += plan.halvings[image]++ == 0 ? 1 : 0;
    const auto left = sizes[image].halved(plan.halvings[image]).pixels();
    plan.bytes -= kDecodedBytes * (pixels - left) * static_cast<std::uint64_t>(std::popcount(used[image]));
    largest.emplace(left, image);
  }
}

}  // namespace

Result<ImagePlan> planImages(const Document& document, std::uint64_t claimed, const ImportLimits& limits) {
  ImagePlan plan;
  plan.halvings.assign(document.images.size(), 0);
  const auto used = usedImages(document);
  std::vector<ImageSize> sizes(used.size());
  std::uint64_t unlikely = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] == 0) continue;
    const auto where = place(document.name, "/images/" + std::to_string(i));
    const auto size = sizeOfImage(*document.images[i], limits.max_image_pixels, where);
    if (!size && size.error().code == ErrorCode::kTooLarge) return tl::unexpected(size.error());
    if (!size) continue;  // whoever needs it says so
    sizes[i] = *size;
    const auto pixels = size->pixels(), likely = kLikelyPixelsAByte * document.images[i]->size();
    unlikely += pixels > likely ? pixels - likely : 0;
    if (unlikely > kTotalImages * limits.max_image_pixels)
      return fail(ErrorCode::kTooLarge, "images have too many pixels for so few bytes", where);
    plan.bytes += kDecodedBytes * pixels * static_cast<std::uint64_t>(std::popcount(used[i]));
    plan.largest_pixels = std::max<std::uint64_t>(plan.largest_pixels, pixels);
  }
  const auto limit = sceneMemoryLimit(limits);
  const auto decoder = kDecoderBytes * plan.largest_pixels;
  const auto room = claimed + decoder < limit.bytes ? limit.bytes - claimed - decoder : 0;
  halveLargest(sizes, used, std::min(kMostImageBytes, room / kShadedThirds * kDecodedThirds), plan);
  plan.two_at_once = plan.largest_pixels <= kMostOfTwo && plan.bytes + decoder <= room;
  if (plan.bytes > room)
    return fail(ErrorCode::kTooLarge, sceneMemoryFault(claimed + decoder + plan.bytes, limit, "its decoded images"),
                place(document.name, "/images"));
  return plan;
}

}  // namespace radiosity::scene
