#include "server/engine/publish/texel_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "server/engine/lit/thread_time.h"
#include "server/engine/publish/quantity_pages.h"

namespace radiosity::engine {
namespace {

/// Pages for single texels take no more than one part in so many of the solve thread's time, however many ask.
constexpr int kReaderShare = 20;

std::vector<std::shared_ptr<const Image>> imagesOf(const LitScene& lit, Quantity quantity,
                                                   const std::shared_ptr<const Lightmaps>& published) {
  std::vector<std::shared_ptr<const Image>> images;
  if (published) {
    for (const auto& page : published->pages) images.emplace_back(page, page->mips.data());
    return images;
  }
  auto pages = makePages(lit, quantity);
  for (auto& page : pages.values)
    images.push_back(std::make_shared<const Image>(shown(pages, std::move(page.irradiance))));
  return images;
}

/// Whether a leaf with area lies there, as the quantity patchId has it.
bool hasSurface(const scene::PatchScene& patches, const TexelRequest& at) {
  const auto lies = [&](const scene::Surface& surface, std::size_t side) {
    const auto& place = surface.place[side];
    if (surface.first_node[side] == scene::kNone || place.page != at.page || at.x < place.x || at.y < place.y)
      return false;
    const auto x = at.x - place.x, y = at.y - place.y;
    return x < surface.width && y < surface.height &&
           patches.node_area[surface.first_node[side] + y * surface.width + x] > 0.0F;
  };
  return std::ranges::any_of(patches.surfaces,
                             [&](const scene::Surface& surface) { return lies(surface, 0) || lies(surface, 1); });
}

Result<void> check(const scene::PatchScene& patches, const TexelRequest& at) {
  const auto pages = patches.pages.size();
  if (at.page >= pages)
    return fail(ErrorCode::kNotFound, fmt::format("there is no lightmap page {} (there are {})", at.page, pages),
                "page");
  const auto& page = patches.pages[at.page];
  const auto outside = [&](std::uint32_t index, std::uint32_t count, const char* member) {
    return fail(ErrorCode::kNotFound,
                fmt::format("page {} has no texel {} = {} (there are {})", at.page, member, index, count), member);
  };
  if (at.x >= page.width) return outside(at.x, page.width, "x");
  if (at.y >= page.height) return outside(at.y, page.height, "y");
  if (hasSurface(patches, at)) return {};
  return fail(ErrorCode::kNotFound, fmt::format("texel {}, {} of page {} belongs to no surface", at.x, at.y, at.page),
              "x");
}

}  // namespace

std::optional<Result<Texel>> TexelReader::read(const TexelRequest& at, const LitScene& lit, const PagesMoment& now,
                                               const PublishedTexels& published, bool may_make) {
  if (auto checked = check(lit.patches(), at); !checked) return tl::unexpected<Error>(checked.error());
  const bool serve = !error_.empty() && of_.layout == now.layout, is_due = Clock::now() >= due_;
  if (!serve && !is_due) return fail(ErrorCode::kBusy, "single texels of this layout cannot be read yet; ask again");
  if (!serve || (of_ != now && is_due)) {
    if (!may_make) return std::nullopt;
    renew(lit, now, published);
  }
  const auto x = static_cast<int>(at.x), y = static_cast<int>(at.y);
  return Texel{of_.revision, of_.tile_version, irradiance_[at.page]->at(x, y), error_[at.page]->at(x, y)};
}

void TexelReader::renew(const LitScene& lit, const PagesMoment& now, const PublishedTexels& published) {
  forget();
  const auto begin = threadTime();
  irradiance_ = imagesOf(lit, Quantity::kIrradiance, published.irradiance);
  error_ = imagesOf(lit, Quantity::kError, published.error);
  of_ = now;
  due_ = Clock::now() + kReaderShare * (threadTime() - begin);
}

void TexelReader::forget() {
  irradiance_.clear();
  error_.clear();
}

}  // namespace radiosity::engine
