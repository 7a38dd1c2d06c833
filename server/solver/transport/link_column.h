// Links of one shooter to every leaf: irradiance there for a radiosity of one, kept so that later bounces, edits of
// light and colour, and finer samples cost no new hemicube. Plain values; one thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "common/archive.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/link_expander.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// A link as 16 bits: 5 of exponent, 11 of mantissa, no sign; 2^-30 to 4, relative error at most 2^-12; 0 is 0. What is
/// cut off is rounded up when it is more than `dither` / 4096 of the last bit: 2048 is to nearest.
[[nodiscard]] std::uint16_t encodeLink(float value, std::uint32_t dither = 2048);
[[nodiscard]] float decodeLink(std::uint16_t code);

/// Codes of links, which copies share until one of them is changed: an edit of geometry leaves most columns as they
/// are, and the scene before it stays, too.
class SharedCodes {
 public:
  [[nodiscard]] const std::vector<std::uint16_t>& all() const { return *codes_; }
  [[nodiscard]] const std::uint16_t* at(std::size_t offset) const { return codes_->data() + offset; }
  /// To be changed.
  [[nodiscard]] std::vector<std::uint16_t>& own() {
    if (codes_.use_count() > 1) codes_ = std::make_shared<std::vector<std::uint16_t>>(*codes_);
    return *codes_;
  }
  void set(std::vector<std::uint16_t>&& codes) {
    codes_ = std::make_shared<std::vector<std::uint16_t>>(std::move(codes));
  }

 private:
  static std::shared_ptr<std::vector<std::uint16_t>> none() {
    static const auto empty = std::make_shared<std::vector<std::uint16_t>>();
    return empty;
  }
  std::shared_ptr<std::vector<std::uint16_t>> codes_ = none();
};

class LinkColumn {
 public:
  /// Averages a new sample of `points` points into what is there. `factor`: of what it says should arrive, escape and
  /// be absorbed. The flux of all links together is kept exactly, whatever 16 bits make of each. `leaf_areas`: unit box
  /// squared, by leaf value.
  void add(const LinkExpander& sample, const LinkSample& totals, double points, std::span<const float> leaf_areas,
           const std::vector<Side>& sides, double factor = 1.0);

  struct ValueRun {
    std::uint32_t first, count;
  };
  struct Totals {
    double due = 0.0, escaped = 0.0, absorbed = 0.0;  ///< as in LinkSample
    Looks open_looks;                                 ///< of all points
    double presumed = 0.0;                            ///< of what is lost: it was once, and was not looked at since
  };
  /// Other links to some leaves, and what all together should deliver, from as many points as before: `values` by leaf
  /// value, of which those of `leaves` (runs of leaf values, ascending, none across sides) count.
  void replace(std::span<const ValueRun> leaves, std::span<const float> values, const Totals& totals,
               std::span<const float> leaf_area, const std::vector<Side>& sides);
  /// The same links in a scene whose sides are numbered otherwise, in any order. `side_after`: by old side, kNone: its
  /// links are left out, what they delivered is not. Shares the codes, unless many of them are of what is left out.
  [[nodiscard]] LinkColumn renumbered(const std::vector<std::uint32_t>& side_after, const std::vector<Side>& before,
                                      const std::vector<Side>& after) const;

  [[nodiscard]] double points() const { return points_; }
  /// Whether so much of what a shooter of this area sends is lost that a look at some leaves, which does not see all of
  /// what is lost, cannot tell how much should arrive.
  [[nodiscard]] static bool isOpen(double area, double lost) { return lost > 0.0099 * area; }
  [[nodiscard]] bool isOpen(double area) const { return isOpen(area, escaped_ + absorbed_); }
  /// Of the points, in the order of the samples, those from where something escapes or is absorbed; of samples that do
  /// not say, all.
  [[nodiscard]] const Looks& openLooks() const { return open_looks_; }
  [[nodiscard]] std::uint32_t samples() const { return samples_; }
  /// What leaves a polygon arrives: all links are multiplied by this, the ratio of what should arrive, in the mean over
  /// all samples, to the sum of the links as they are kept. Otherwise small errors (one point for a whole leaf, pixels
  /// on edges, the rounding to 16 bits) would be multiplied by interreflection. Bounded, for polygons that see next to
  /// nothing; the bounds are wider than what one random point of a wall makes of the walls of a cube (0.3 to 3), or
  /// such a room would lose light with every bounce.
  [[nodiscard]] double gain() const { return static_cast<double>(gain_); }
  /// What was last said of all links together.
  [[nodiscard]] Totals totals() const { return {due_, escaped_, absorbed_, open_looks_, presumed_}; }
  /// Flux that leaves the scene, and that falls on unlit sides, for a radiosity of one.
  [[nodiscard]] double escaped() const { return escaped_; }
  [[nodiscard]] double absorbed() const { return absorbed_; }
  [[nodiscard]] std::size_t bytes() const { return code_.all().size() * kLeafBytes + runs_.size() * sizeof(runs_[0]); }

  /// Adds radiosity[c] times the links to plane c of irradiance, by leaf value.
  void apply(const std::array<float, 3>& radiosity, const std::array<float*, 3>& irradiance) const;
  /// Adds `factor` times the squares of the links, by leaf value.
  void addSquares(float factor, std::span<float> sums) const;
  /// The links to the leaves of one side, whose values begin at `first_value`; false when there are none.
  [[nodiscard]] bool decode(std::uint32_t first_value, std::span<float> leaves) const;

  /// Sums over leaves of area times the product of two columns' links.
  [[nodiscard]] static double product(const LinkColumn& a, const LinkColumn& b, std::span<const float> leaf_area);

  void save(ArchiveWriter& to) const { visit(to, *this); }
  /// False: it is not of a scene with so many sides and leaf values.
  [[nodiscard]] bool restore(ArchiveReader& from, std::size_t sides, std::size_t values);

  static constexpr std::size_t kLeafBytes = sizeof(std::uint16_t);
  /// Consecutive sides, with all their leaves. Small sides between others are kept though nothing reaches them: their
  /// zeros take less than a run of their own.
  struct Run {
    std::uint32_t side, side_count, first_value, count, offset;
  };
  [[nodiscard]] std::span<const Run> runs() const { return runs_; }

 private:
  [[nodiscard]] static const std::vector<std::uint16_t>& codesOf(const LinkColumn& self) { return self.code_.all(); }
  [[nodiscard]] static std::vector<std::uint16_t>& codesOf(LinkColumn& self) { return self.code_.own(); }
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.runs_, self.scale_, self.gain_, codesOf(self), self.samples_, self.points_, self.due_, self.delivered_,
            self.escaped_, self.absorbed_, self.open_looks_.bits, self.presumed_);
  }
  void makeRoom(std::span<const std::uint32_t> reached, const std::vector<Side>& sides);
  void grow(const LinkExpander& sample, const std::vector<Side>& sides);
  void growTo(float largest);
  void keepFlux(std::span<const float> leaf_area);

  void addTo(const Run& run, std::uint32_t first_value, std::uint32_t count, float kept, float added,
             std::span<const float> fresh);

  std::vector<Run> runs_;    // by ascending side
  float scale_ = 0x1p-100F;  // of the codes; a power of two that grows with the largest link
  float gain_ = 1.0F;
  SharedCodes code_;
  std::uint32_t samples_ = 0;
  double points_ = 0.0, due_ = 0.0, delivered_ = 0.0, escaped_ = 0.0, absorbed_ = 0.0, presumed_ = 0.0;
  Looks open_looks_;
};

}  // namespace radiosity::solver
