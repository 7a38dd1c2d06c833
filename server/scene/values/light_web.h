// The photometric web of a lamp: candela by direction, as a table that is one list of floats, so that it travels to the
// renderers as it is. Plain values; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace radiosity::scene {

/// More angles than this, polar times azimuth, are refused: half a degree all around is less.
inline constexpr std::size_t kMostWebCandela = std::size_t{1} << 18U;
/// Numbers of a table before the angles: how many of either there are.
inline constexpr std::size_t kWebHead = 2;

/// A table: the number of polar angles (2 at least), that of azimuths (1 at least), the polar angles, the azimuths
/// (both degrees, ascending), then the candela, azimuth by azimuth. One azimuth alone stands for all.
struct LightWeb {
  std::vector<float> table;
  double lumens = 0.0;    ///< integral of the candela over the sphere
  std::uint64_t key = 0;  ///< of the table

  [[nodiscard]] std::span<const float> candela() const {
    return std::span(table).subspan(kWebHead + static_cast<std::size_t>(table[0]) + static_cast<std::size_t>(table[1]));
  }
  /// All finite, and as long as the list says. O(n).
  [[nodiscard]] static LightWeb of(const std::vector<float>& polar_deg, const std::vector<float>& azimuth_deg,
                                   const std::vector<float>& candela);
};

/// Equal where the tables are.
class SharedWeb {
 public:
  SharedWeb() = default;
  explicit SharedWeb(std::shared_ptr<const LightWeb> web) : web_(std::move(web)) {}

  explicit operator bool() const { return web_ != nullptr; }
  const LightWeb& operator*() const { return *web_; }
  const LightWeb* operator->() const { return web_.get(); }
  [[nodiscard]] const std::shared_ptr<const LightWeb>& shared() const { return web_; }
  bool operator==(const SharedWeb& other) const {
    if (web_ == other.web_ || !web_ || !other.web_) return web_ == other.web_;
    return web_->key == other.web_->key && web_->table == other.web_->table;
  }

 private:
  std::shared_ptr<const LightWeb> web_;
};

/// Whether it is a table that webCandela() may read: its counts fit its length. O(1).
[[nodiscard]] bool isWebTable(std::span<const float> table);

/// Interpolated between the angles, bilinearly; 0 beyond them. `polar_deg` in [0, 180], `azimuth_deg` in [-180, 180].
[[nodiscard]] float webCandela(std::span<const float> table, float polar_deg, float azimuth_deg);

}  // namespace radiosity::scene
