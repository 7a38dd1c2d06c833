// EULUMDAT (.ldt), by lines: Stockmar 1990, as described by Helios32 and Paul Bourke.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/scene/import/photometric_file.h"

namespace radiosity::scene {
namespace {

constexpr double kStatedOff = 0.05;
constexpr std::size_t kMostLampSets = 20;  // the format's own limit
constexpr std::size_t kDirectRatios = 10;
constexpr double kSameDegrees = 1e-3;

/// Symmetry, by its number in the file.
enum Symmetry : std::size_t { kNone, kAxis, kC0C180, kC90C270, kBoth };

class EulumdatFile {
 public:
  EulumdatFile(std::string_view text, const std::string& where) : lines_(text), where_(where) {}

  Result<PhotometricFile> read() {
    if (const auto done = readHead(); !done) return tl::unexpected(done.error());
    if (const auto done = readLamps(); !done) return tl::unexpected(done.error());
    for (std::size_t i = 0; i < kDirectRatios; ++i)
      if (const auto value = number("direct ratio", -1e6, 1e6); !value) return tl::unexpected(value.error());
    if (const auto done = readWeb(); !done) return tl::unexpected(done.error());
    // Of this format the luminaire's own share of the lamps' light is stated.
    const double stated = lumens_ * output_ratio_;
    if (stated > 0.0 && std::abs(file_.web.lumens - stated) > kStatedOff * stated)
      file_.warnings.push_back("its web sends " + lumensText(file_.web.lumens) +
                               ", but its lamps and output ratio say " + lumensText(stated));
    return std::move(file_);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(const std::string& what) const {
    return fail(ErrorCode::kInvalidScene, atLine(lines_.number()) + what, where_);
  }
  Result<void> skip(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
      if (!lines_.next()) return bad("the file ends early: it is neither an IES nor a whole EULUMDAT file");
    return {};
  }
  Result<double> number(const char* name, double least, double most) {
    const auto line = lines_.next();
    if (!line) return bad(std::string("the file ends before its ") + name);
    std::string text(line->substr(0, 40));
    std::ranges::replace(text, ',', '.');  // of languages that write numbers so
    const auto value = photometricNumber(text);
    if (!value || !(*value >= least && *value <= most)) return bad(std::string(name) + " is no number in its range");
    return *value;
  }
  Result<std::size_t> count(const char* name, double least, double most) {
    const auto value = number(name, least, most);
    if (!value) return tl::unexpected(value.error());
    if (*value != std::floor(*value)) return bad(std::string(name) + " must be a whole number");
    return static_cast<std::size_t>(*value);
  }

  Result<void> readHead() {
    if (const auto done = skip(2); !done) return done;
    const auto symmetry = count("symmetry indicator", 0, 4);
    const auto planes = symmetry ? count("number of C planes", 1, 100'000) : symmetry;
    if (!planes) return tl::unexpected(planes.error());
    if (const auto done = skip(1); !done) return done;
    const auto angles = count("number of intensities in each C plane", 2, 100'000);
    if (!angles) return tl::unexpected(angles.error());
    if (*planes * *angles > kMostWebCandela) return bad("more than 262144 directions");
    symmetry_ = *symmetry;
    planes_ = *planes;
    angles_ = *angles;
    if (symmetry_ == kBoth && planes_ % 4 != 0)
      return bad("C planes that are symmetric to two planes must be fourfold");
    if (symmetry_ == kC90C270 && planes_ % 4 != 0) return bad("C planes that begin at C270 must be fourfold");
    if (symmetry_ == kC0C180 && planes_ % 2 != 0) return bad("C planes that are symmetric must be twofold");
    if (const auto done = skip(16); !done) return done;  // to the downward flux fraction
    const auto ratio = number("light output ratio", 0, 1e4);
    const auto factor = ratio ? number("conversion factor", 0, 1e6) : ratio;
    const auto tilt = factor ? number("tilt", -360, 360) : factor;
    if (!tilt) return tl::unexpected(tilt.error());
    if (*tilt != 0.0) file_.warnings.push_back(atLine(lines_.number()) + "the tilt while measuring is ignored");
    output_ratio_ = *ratio / 100.0;
    factor_ = *factor > 0.0 ? *factor : 1.0;
    return {};
  }

  /// Sets are alternatives; the first is the usual one.
  Result<void> readLamps() {
    const auto sets = count("number of lamp sets", 1, kMostLampSets);
    if (!sets) return tl::unexpected(sets.error());
    for (std::size_t set = 0; set < *sets; ++set) {
      if (const auto done = skip(2); !done) return done;
      const auto lumens = number("lumens of a lamp set", 0, 1e12);
      if (!lumens) return tl::unexpected(lumens.error());
      if (set == 0) lumens_ = *lumens;
      if (const auto done = skip(3); !done) return done;
    }
    if (*sets > 1) file_.warnings.emplace_back("of several lamp sets the first is lit");
    return {};
  }

  Result<std::vector<double>> ascending(const char* name, std::size_t count, double most) {
    std::vector<double> angles;
    for (std::size_t i = 0; i < count; ++i) {
      const auto angle = number(name, 0, most);
      if (!angle) return tl::unexpected(angle.error());
      if (!angles.empty() && !(*angle >= angles.back() + kLeastAngle)) return bad(std::string(name) + "s must ascend");
      angles.push_back(*angle);
    }
    return angles;
  }

  /// The C planes that the file has, in its order.
  [[nodiscard]] std::vector<std::size_t> planesTold() const {
    std::vector<std::size_t> planes;
    const std::array<std::size_t, 5> counts{planes_, 1, planes_ / 2 + 1, planes_ / 2 + 1, planes_ / 4 + 1};
    const std::size_t first = symmetry_ == kC90C270 ? 3 * planes_ / 4 : 0;
    for (std::size_t i = 0; i < counts[symmetry_]; ++i) planes.push_back(first + i);
    return planes;
  }

  Result<void> readWeb() {
    const auto planes = ascending("C plane", planes_, 360.0);
    if (!planes) return tl::unexpected(planes.error());
    const auto polar = ascending("G angle", angles_, 180.0);
    if (!polar) return tl::unexpected(polar.error());
    WebColumns web;
    web.polar.assign(polar->begin(), polar->end());
    for (const auto plane : planesTold()) {
      const double turn = symmetry_ == kC90C270 && plane < planes_ ? -360.0 : 0.0;  // they go from -90 to 90
      WebColumns::Column column{symmetry_ == kAxis ? 0.0 : (*planes)[plane % planes_] + turn, {}};
      for (std::size_t i = 0; i < angles_; ++i) {
        const auto value = number("intensity", 0, 1e12);
        if (!value) return tl::unexpected(value.error());
        const double candela = *value * factor_ * lumens_ / 1000.0;
        if (!(candela <= 1e12)) return bad("candela are above 1e12");
        column.candela.push_back(static_cast<float>(candela));
      }
      web.columns.push_back(std::move(column));
    }
    return complete(web);
  }

  Result<void> complete(WebColumns& web) {
    const double first = web.columns.front().azimuth, last = web.columns.back().azimuth;
    const auto spans = [&](double from, double to) {
      return std::abs(first - from) < kSameDegrees && std::abs(last - to) < kSameDegrees;
    };
    if (symmetry_ == kC0C180 && !spans(0, 180)) return bad("C planes must go from 0 to 180");
    if (symmetry_ == kC90C270 && !spans(-90, 90)) return bad("C planes must go from 270 to 90");
    if (symmetry_ == kBoth && !spans(0, 90)) return bad("C planes must go from 0 to 90");
    if (symmetry_ == kC90C270 || symmetry_ == kBoth) web.mirror(90.0);
    if (symmetry_ == kC0C180 || symmetry_ == kBoth) web.mirror(180.0);
    if (symmetry_ == kNone) web.close();
    file_.web = web.web();
    return {};
  }

  FileLines lines_;
  const std::string& where_;
  PhotometricFile file_;
  std::size_t symmetry_ = 0, planes_ = 0, angles_ = 0;
  double lumens_ = 0.0, output_ratio_ = 0.0, factor_ = 1.0;
};

}  // namespace

Result<PhotometricFile> parseEulumdat(std::string_view text, const std::string& where) {
  return EulumdatFile(text, where).read();
}

}  // namespace radiosity::scene
