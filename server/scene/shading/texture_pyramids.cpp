#include "server/scene/shading/texture_pyramids.h"

#include <algorithm>
#include <initializer_list>

namespace radiosity::scene {
namespace {

/// That are kept beside those in use, and how many at most.
constexpr std::size_t kMostBytes = std::size_t{256} << 20, kMostKept = 64;
/// Width and height of a coarse look, at most.
constexpr int kCoarse = 64;

/// A texture read on a grid that may be finer than its own, or coarser.
struct Regridded {
  const Texture* texture;  ///< null: white
  int width, height;

  [[nodiscard]] glm::vec4 at(int x, int y) const {
    if (texture == nullptr) return glm::vec4(1.0F);
    const auto scaled = [](int i, int to, int from) {
      return to == from ? i : static_cast<int>(std::int64_t{i} * to / from);
    };
    return pixelOf(*texture, scaled(x, texture->width, width), scaled(y, texture->height, height));
  }
};

float coverageOf(const PictureStack& stack, float alpha) {
  if (!stack.is_mask) return alpha;
  return stack.alpha_factor * alpha >= stack.alpha_cutoff ? 1.0F : 0.0F;
}

TexturePyramid::Pixels pixelsOf(const PictureStack& stack, int width, int height) {
  const Regridded colour{stack.colour, width, height}, metal{stack.metal, width, height};
  const Regridded shine{stack.shine, width, height}, alpha{stack.alpha, width, height};
  return [stack, colour, metal, shine, alpha](int x, int y) {
    const glm::vec4 texel = colour.at(x, y);
    glm::vec3 rgb(texel);
    if (metal.texture != nullptr) rgb *= 1.0F - stack.metal_factor * metal.at(x, y).b;
    if (shine.texture != nullptr) {
      const glm::vec3 specular = stack.shine_factor * glm::vec3(shine.at(x, y));
      rgb *= 1.0F - std::max({specular.r, specular.g, specular.b});
    }
    if (alpha.texture == nullptr) return glm::vec4(rgb, 1.0F);
    const float opacity = alpha.texture == colour.texture ? texel.a : alpha.at(x, y).a;
    return glm::vec4(rgb, coverageOf(stack, opacity));
  };
}

/// The same coverage, told by the least alpha of a byte that counts: there are no others, however many cut-offs
/// materials name.
PictureStack withLeastAlpha(PictureStack stack) {
  if (!stack.is_mask) return stack;
  const auto counts = [&](float alpha) { return coverageOf(stack, alpha) > 0.0F; };
  const auto least = std::ranges::find_if(kByteValues.plain, counts);
  stack.alpha_cutoff = least == kByteValues.plain.end() ? 2.0F : *least;
  stack.alpha_factor = 1.0F;
  return stack;
}

}  // namespace

std::shared_ptr<const TexturePyramid> TexturePyramids::of(const PictureStack& asked) {
  const auto stack = withLeastAlpha(asked);
  const auto found = std::ranges::find(kept_, stack, &Kept::stack);
  if (found != kept_.end()) {
    kept_.splice(kept_.begin(), kept_, found);
    return found->pyramid;
  }
  int width = 1, height = 1;
  for (const auto* texture : {stack.colour, stack.metal, stack.shine, stack.alpha}) {
    if (texture == nullptr) continue;
    width = std::max(width, texture->width);
    height = std::max(height, texture->height);
  }
  const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  ++made_;
  if ((width > kCoarse || height > kCoarse) && pixels_ + pixels > most_pixels_) {
    ++coarse_;
    width = std::min(width, kCoarse);
    height = std::min(height, kCoarse);
  } else {
    pixels_ += pixels;
  }
  auto pyramid =
      std::make_shared<const TexturePyramid>(width, height, pixelsOf(stack, width, height), stack.alpha == nullptr);
  bytes_ += pyramid->bytes();
  kept_.push_front({stack, pyramid});
  makeRoom();
  return pyramid;
}

/// Whoever uses one that goes keeps it.
void TexturePyramids::makeRoom() {
  while (kept_.size() > 1 && (bytes_ > kMostBytes || kept_.size() > kMostKept)) {
    bytes_ -= kept_.back().pyramid->bytes();
    kept_.pop_back();
  }
}

}  // namespace radiosity::scene
