// What one session still has to send: a dirty set, not a queue. It compares the newest lightmaps with what this client
// was sent, so a client that reads slowly skips versions instead of falling behind. Owned by a session; its strand
// only.
//
// Order: tiles that the client has nothing of come first, coarse mips before fine ones, so that a picture stands at
// once; then whatever gains most for its bytes: change x area covered x versions behind. The last factor grows with
// waiting, so nothing starves.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "protocol/tile_frame.h"
#include "server/engine/engine.h"
#include "server/net/tile_cache.h"

namespace radiosity::net {

struct OutgoingTile {
  std::array<std::uint8_t, protocol::kTileHeaderBytes> header{};
  TileCache::Pixels pixels;
  [[nodiscard]] std::size_t bytes() const { return header.size() + pixels->payload.size(); }
};

class TileLane {
 public:
  void setFormat(protocol::PixelFormat format, protocol::Codec codec);
  /// Starts streaming, or changes it; pages and mips outside the subscription are not sent. Another quantity starts
  /// afresh: nothing of it counts as sent.
  void subscribe(const protocol::SubscribeCall& call);
  [[nodiscard]] bool subscribed() const { return subscription_.has_value(); }
  [[nodiscard]] protocol::Quantity quantity() const {
    return subscription_ ? subscription_->quantity : protocol::Quantity::kIrradiance;
  }
  [[nodiscard]] double maxHz() const { return subscription_ ? subscription_->max_hz : 0.0; }
  /// The client holds every tile of a quantity up to a version; to be called before subscribe().
  void resumeFrom(const protocol::Resume& resume) { resume_ = resume; }

  /// Takes the newest lightmaps of the quantity subscribed to; others are passed over. True: their layout is new, or
  /// they are the first, so `lightmaps` must be sent before the next tile.
  bool setLightmaps(std::shared_ptr<const engine::Lightmaps> lightmaps);
  /// For lightmaps that are newer than those taken, at a time when the rate does not allow to take them: what is still
  /// to be sent is sent from them, so that a session whose client is slow does not keep old ones in memory. False:
  /// their layout is another and something is still to be sent; they must be taken instead.
  [[nodiscard]] bool sendFrom(const std::shared_ptr<const engine::Lightmaps>& newer);
  /// Whether lightmaps are kept in memory: something of them is still to be sent.
  [[nodiscard]] bool holdsLightmaps() const { return lightmaps_ != nullptr; }

  /// Credit is capped; see kMaxCreditBytes.
  void addCredit(std::int64_t bytes);
  void setCredit(std::int64_t bytes) { credit_ = bytes; }
  [[nodiscard]] std::int64_t credit() const { return credit_; }

  /// The most useful tile, or none: nothing is dirty, or the client gave no credit. Takes the credit.
  [[nodiscard]] std::optional<OutgoingTile> next(TileCache& cache);
  /// Once for each version: everything of it was handed out.
  [[nodiscard]] std::optional<protocol::Bookmark> takeBookmark();
  [[nodiscard]] std::uint64_t tilesFailed() const { return failed_; }

 private:
  struct Entry {
    std::uint32_t page, mip, tile;
    bool fresh;     ///< the client has nothing of it
    double weight;  ///< change x area x versions behind
  };
  struct SentPage {
    std::vector<std::vector<std::uint64_t>> version;  ///< by mip and tile; 0: never
    bool reset = true;                                ///< the next tile carries kTileReset
  };

  /// Of the lightmaps taken last: this much outlives them.
  struct Taken {
    std::uint64_t layout, revision, tile_version;
    std::size_t pages;
  };

  [[nodiscard]] bool laidOutAlike(const engine::Lightmaps& lightmaps) const;
  void startLayout();
  void findDirty();
  [[nodiscard]] bool wanted(std::uint32_t page) const;
  [[nodiscard]] Result<OutgoingTile> frameOf(const Entry& entry, TileCache& cache);

  std::optional<protocol::SubscribeCall> subscription_;
  protocol::PixelFormat format_ = protocol::PixelFormat::kRgba16f;
  protocol::Codec codec_ = protocol::Codec::kNone;
  std::optional<Taken> taken_;
  std::shared_ptr<const engine::Lightmaps> lightmaps_;  ///< those, or newer ones; null once everything was handed out
  std::vector<SentPage> sent_;
  std::vector<Entry> dirty_;  ///< best last
  std::optional<protocol::Resume> resume_;
  std::uint64_t bookmarked_ = 0;
  std::int64_t credit_ = protocol::kDefaultCreditBytes;
  std::uint64_t failed_ = 0;
};

}  // namespace radiosity::net
