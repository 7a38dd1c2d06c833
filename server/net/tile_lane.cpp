#include "server/net/tile_lane.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/check.h"
#include "common/log.h"
#include "server/net/convert.h"

namespace radiosity::net {
namespace {

double changeOf(const engine::PageSnapshot& page, std::uint32_t mip, std::uint32_t tile) {
  if (mip >= page.tile_change.size() || tile >= page.tile_change[mip].size()) return 1.0;
  const double change = page.tile_change[mip][tile];
  return std::isfinite(change) ? std::clamp(change, 1e-6, 1e6) : 1.0;
}

}  // namespace

void TileLane::setFormat(protocol::PixelFormat format, protocol::Codec codec) {
  format_ = format;
  codec_ = codec;
}

void TileLane::subscribe(const protocol::SubscribeCall& call) {
  const bool another = subscription_ && subscription_->quantity != call.quantity;
  subscription_ = call;
  if (another) {
    taken_.reset();
    lightmaps_.reset();
    dirty_.clear();
  }
  bookmarked_ = 0;  // of the new choice
  if (lightmaps_ != nullptr) findDirty();
}

bool TileLane::wanted(std::uint32_t page) const {
  const auto& chosen = subscription_->lightmaps;
  return chosen.empty() || std::find(chosen.begin(), chosen.end(), page) != chosen.end();
}

void TileLane::startLayout() {
  const bool resumes = resume_ && resume_->quantity == subscription_->quantity;
  sent_.clear();
  for (const auto& page : lightmaps_->pages) {
    SentPage sent;
    RAD_CHECK_EQ(page->mipCount(), page->tile_version.size());
    for (const auto& versions : page->tile_version) {
      auto& known = sent.version.emplace_back(versions.size(), 0);
      for (std::size_t t = 0; resumes && t < versions.size(); ++t) {
        if (versions[t] > resume_->tile_version) continue;
        known[t] = versions[t];
        sent.reset = false;  // the client goes on with what it has
      }
    }
    sent_.push_back(std::move(sent));
  }
  resume_.reset();
  bookmarked_ = 0;
}

bool TileLane::laidOutAlike(const engine::Lightmaps& lightmaps) const {
  return taken_ && taken_->layout == lightmaps.layout && taken_->pages == lightmaps.pages.size();
}

bool TileLane::sendFrom(const std::shared_ptr<const engine::Lightmaps>& newer) {
  if (lightmaps_ == nullptr) return true;
  if (!laidOutAlike(*newer)) return false;
  lightmaps_ = newer;
  return true;
}

bool TileLane::setLightmaps(std::shared_ptr<const engine::Lightmaps> lightmaps) {
  if (!subscription_ || lightmaps == nullptr) return false;
  if (toQuantity(lightmaps->quantity) != subscription_->quantity) return false;
  const bool new_layout = !laidOutAlike(*lightmaps);
  taken_ = {lightmaps->layout, lightmaps->revision, lightmaps->tile_version, lightmaps->pages.size()};
  lightmaps_ = std::move(lightmaps);
  if (new_layout) startLayout();
  findDirty();
  return new_layout;
}

void TileLane::findDirty() {
  dirty_.clear();
  for (std::uint32_t p = 0; p < lightmaps_->pages.size(); ++p) {
    if (!wanted(p)) continue;
    const auto& page = *lightmaps_->pages[p];
    const auto last = std::min<std::size_t>(page.mipCount(), std::size_t{subscription_->max_mip} + 1);
    for (std::uint32_t m = subscription_->min_mip; m < last; ++m) {
      const auto& now = page.tile_version[m];
      const auto& then = sent_[p].version[m];
      RAD_CHECK_EQ(now.size(), then.size());  // a page changes its size only with the layout
      for (std::uint32_t t = 0; t < now.size(); ++t) {
        if (now[t] == then[t]) continue;
        const double change = changeOf(page, m, t);
        const double behind =
            static_cast<double>(lightmaps_->tile_version - std::min(then[t], lightmaps_->tile_version));
        dirty_.push_back({p, m, t, then[t] == 0, std::ldexp(change * behind, 2 * static_cast<int>(m))});
      }
    }
  }
  std::sort(dirty_.begin(), dirty_.end(), [](const Entry& a, const Entry& b) {
    if (a.fresh != b.fresh) return b.fresh;
    if (a.fresh && a.mip != b.mip) return a.mip < b.mip;
    return a.weight < b.weight;
  });
}

Result<OutgoingTile> TileLane::frameOf(const Entry& entry, TileCache& cache) {
  const auto& page = *lightmaps_->pages[entry.page];
  const auto version = page.tile_version[entry.mip][entry.tile];
  auto pixels = cache.get(
      {lightmaps_->quantity, lightmaps_->layout, version, entry.page, entry.mip, entry.tile, format_, codec_}, page);
  if (!pixels) return tl::unexpected(std::move(pixels.error()));
  const auto across =
      (static_cast<std::uint32_t>(page.size(entry.mip).x) + protocol::kTileSide - 1) / protocol::kTileSide;
  protocol::TileHeader header;
  header.kind = subscription_->quantity;
  header.page = entry.page;
  header.mip = static_cast<std::uint16_t>(entry.mip);
  header.x = entry.tile % across * protocol::kTileSide;
  header.y = entry.tile / across * protocol::kTileSide;
  header.revision = lightmaps_->revision;
  header.tile_version = version;
  header.shots = lightmaps_->shots;
  header.error = std::isfinite(lightmaps_->error) ? std::max(0.0F, lightmaps_->error) : 1e9F;
  if (lightmaps_->final) header.flags |= protocol::kTileFinal;
  if (std::exchange(sent_[entry.page].reset, false)) header.flags |= protocol::kTileReset;
  return OutgoingTile{encodeTileHeader(header, **pixels), std::move(*pixels)};
}

std::optional<OutgoingTile> TileLane::next(TileCache& cache) {
  while (credit_ > 0 && !dirty_.empty()) {
    const auto entry = dirty_.back();
    dirty_.pop_back();
    sent_[entry.page].version[entry.mip][entry.tile] =
        lightmaps_->pages[entry.page]->tile_version[entry.mip][entry.tile];
    auto frame = frameOf(entry, cache);
    if (!frame) {
      if (failed_++ == 0) log::error("page {} mip {}: {}", entry.page, entry.mip, frame.error().text());
      continue;
    }
    credit_ -= static_cast<std::int64_t>(frame->bytes());
    return std::move(*frame);
  }
  return std::nullopt;
}

void TileLane::addCredit(std::int64_t bytes) { credit_ = std::min(credit_ + bytes, protocol::kMaxCreditBytes); }

std::optional<protocol::Bookmark> TileLane::takeBookmark() {
  if (!subscription_ || lightmaps_ == nullptr || !dirty_.empty()) return std::nullopt;
  lightmaps_.reset();  // at a low rate the next ones may be long in coming
  if (bookmarked_ == taken_->tile_version) return std::nullopt;
  bookmarked_ = taken_->tile_version;
  return protocol::Bookmark{taken_->revision, taken_->tile_version, subscription_->quantity};
}

}  // namespace radiosity::net
