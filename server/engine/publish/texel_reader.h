// What single texels of the lightmaps hold, for those who ask for one at a time, such as a light meter. Owned by the
// solve loop; solve thread only.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "common/image.h"
#include "common/result.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"

namespace radiosity::engine {

/// The moment that pages are of. `steps`: of the solver so far, where no published version stands for them.
struct PagesMoment {
  std::uint64_t layout = 0, revision = 0, tile_version = 0, steps = 0;
  bool operator==(const PagesMoment&) const = default;
};

/// What is published of the two quantities as `PagesMoment::tile_version`; null: nothing.
struct PublishedTexels {
  std::shared_ptr<const Lightmaps> irradiance, error;
};

class TexelReader {
 public:
  /// kNotFound where there is no such page or texel, or where it belongs to no surface: `where` is "page", "x" or "y".
  /// What is published is read from there. Pages of the other quantity are made, and serve as long as `now` stays the
  /// same, and in any case until making them was no more than a twentieth of the time since: so an answer may be of an
  /// earlier moment, of the same layout, and says of which. Costs a look at every surface, and where pages are made
  /// what makePages() costs; 12 bytes a texel for each quantity that is not published.
  /// Pages of another layout that are asked for sooner than that are kBusy. `may_make`: without it nothing is where
  /// pages would have to be made.
  [[nodiscard]] std::optional<Result<Texel>> read(const TexelRequest& at, const LitScene& lit, const PagesMoment& now,
                                                  const PublishedTexels& published, bool may_make);

  void forget();  ///< lets the pages go
  /// Lets pages of another layout go.
  void keepOnly(std::uint64_t layout) {
    if (of_.layout != layout) forget();
  }

 private:
  using Clock = std::chrono::steady_clock;
  using Pages = std::vector<std::shared_ptr<const Image>>;

  void renew(const LitScene& lit, const PagesMoment& now, const PublishedTexels& published);

  PagesMoment of_;
  Pages irradiance_, error_;  // empty: none are kept
  Clock::time_point due_{};   // when they may be made anew
};

}  // namespace radiosity::engine
