// LM-63, the format of the Illuminating Engineering Society of North America.
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "server/scene/import/photometric_file.h"

namespace radiosity::scene {
namespace {

constexpr double kSameAngle = 1e-3;
/// A web may send so much more than its lamps are said to.
constexpr double kLumensOff = 0.05;
/// Luminaires that let out less of their lamps' light are rare; files whose candela lack a multiplier are not.
constexpr double kLeastShare = 0.1;

bool isAt(double angle, double at) { return std::abs(angle - at) < kSameAngle; }

/// The numbers of a file, across lines: blanks and commas part them.
class Numbers {
 public:
  Numbers(FileLines& lines, const std::string& where) : lines_(lines), where_(where) {}

  [[nodiscard]] tl::unexpected<Error> bad(const std::string& what) const {
    return fail(ErrorCode::kInvalidScene, atLine(lines_.number()) + what, where_);
  }
  Result<double> next(const char* name) {
    while (rest_.empty()) {
      const auto line = lines_.next();
      if (!line) return bad(std::string("the file ends before its ") + name);
      rest_ = *line;
      skipBlanks();
    }
    const auto token = rest_.substr(0, rest_.find_first_of(kBetween));
    rest_.remove_prefix(token.size());
    skipBlanks();
    const auto value = photometricNumber(token);
    if (!value) return bad(std::string(name) + " must be numbers of at most 1e12, not '" + shown(token) + "'");
    return *value;
  }
  Result<double> within(const char* name, double least, double most) {
    auto value = next(name);
    if (value && !(*value >= least && *value <= most))
      return bad(std::string(name) + " is out of range: " + std::to_string(*value));
    return value;
  }
  Result<std::size_t> count(const char* name, double least, double most) {
    const auto value = within(name, least, most);
    if (!value) return tl::unexpected(value.error());
    if (*value != std::floor(*value)) return bad(std::string(name) + " must be a whole number");
    return static_cast<std::size_t>(*value);
  }
  Result<std::vector<double>> ascending(const char* name, std::size_t count, double least, double most) {
    std::vector<double> angles;
    for (std::size_t i = 0; i < count; ++i) {
      const auto angle = within(name, least, most);
      if (!angle) return tl::unexpected(angle.error());
      if (!angles.empty() && !(*angle >= angles.back() + kLeastAngle)) return bad(std::string(name) + " must ascend");
      angles.push_back(*angle);
    }
    return angles;
  }
  [[nodiscard]] bool atEnd() {
    while (rest_.empty()) {
      const auto line = lines_.next();
      if (!line) return true;
      rest_ = *line;
      skipBlanks();
    }
    return false;
  }

 private:
  static constexpr std::string_view kBetween = " \t\v\f,";

  static std::string shown(std::string_view token) {
    std::string text;
    for (const char c : token.substr(0, 24)) text += c >= ' ' && c <= '~' ? c : '?';
    return text;
  }
  void skipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(kBetween), rest_.size())); }

  FileLines& lines_;
  const std::string& where_;
  std::string_view rest_;
};

struct Head {
  std::string_view version, tilt;
};

/// The lines up to TILT.
Result<Head> readHead(FileLines& lines, const std::string& where) {
  Head head;
  for (auto line = lines.next(); line; line = lines.next()) {
    if (lines.number() == 1) head.version = *line;
    if (!line->starts_with("TILT=")) continue;
    head.tilt = line->substr(5);
    return head;
  }
  return fail(ErrorCode::kInvalidScene, "an IES file without a line TILT=", where);
}

struct Photometry {
  double lamps = 1.0, lumens = 0.0, factor = 1.0;
  std::size_t vertical = 0, horizontal = 0, type = 1;
};

/// `of_2002`: from then on the second ballast factor is none.
Result<Photometry> readPhotometry(Numbers& numbers, bool of_2002) {
  Photometry read;
  const auto lamps = numbers.within("number of lamps", 1, 1e6);
  const auto lumens = lamps ? numbers.next("lumens per lamp") : lamps;
  const auto multiplier = lumens ? numbers.within("candela multiplier", 1e-12, 1e12) : lumens;
  if (!multiplier) return tl::unexpected(multiplier.error());
  const auto most = static_cast<double>(kMostWebCandela);
  const auto vertical = numbers.count("number of vertical angles", 2, most);
  if (!vertical) return tl::unexpected(vertical.error());
  const auto horizontal = numbers.count("number of horizontal angles", 1, most);
  if (!horizontal) return tl::unexpected(horizontal.error());
  if (*vertical * *horizontal > kMostWebCandela) return numbers.bad("more than 262144 directions");
  const auto type = numbers.count("photometric type", 1, 3);
  if (!type) return tl::unexpected(type.error());
  for (const char* name : {"units", "width", "length", "height"})
    if (const auto value = numbers.next(name); !value) return tl::unexpected(value.error());
  const auto ballast = numbers.within("ballast factor", 1e-6, 1e6);
  const auto second = ballast ? numbers.within("ballast-lamp factor", 0, 1e6) : ballast;
  const auto watts = second ? numbers.next("input watts") : second;
  if (!watts) return tl::unexpected(watts.error());
  const bool counts = !of_2002 && *second > 0.0;
  read = {*lamps, *lumens, *multiplier * *ballast * (counts ? *second : 1.0), *vertical, *horizontal, *type};
  return read;
}

/// TILT=INCLUDE: how a lamp dims as its luminaire is tilted, which no node says. Checked, and left out.
Result<void> skipTilt(Numbers& numbers, std::vector<std::string>& warnings) {
  if (const auto geometry = numbers.count("lamp-to-luminaire geometry", 1, 3); !geometry)
    return tl::unexpected(geometry.error());
  const auto count = numbers.count("number of tilt angles", 0, 100'000);
  if (!count) return tl::unexpected(count.error());
  if (const auto angles = numbers.ascending("tilt angles", *count, -360, 360); !angles)
    return tl::unexpected(angles.error());
  bool dims = false;
  for (std::size_t i = 0; i < *count; ++i) {
    const auto factor = numbers.within("tilt factors", 0, 1e6);
    if (!factor) return tl::unexpected(factor.error());
    dims = dims || *factor != 1.0;
  }
  if (dims) warnings.emplace_back("TILT factors are ignored: the lamp shines as if it hung upright");
  return {};
}

/// Type C: symmetries by where the horizontal angles end.
bool completeTurns(WebColumns& web, std::vector<std::string>& warnings) {
  const double first = web.columns.front().azimuth, last = web.columns.back().azimuth;
  if (web.columns.size() == 1) return true;
  if (isAt(first, 90.0) && isAt(last, 270.0)) {
    web.mirror(90.0);
    return true;
  }
  if (!isAt(first, 0.0)) return false;
  if (isAt(last, 90.0)) web.mirror(90.0);
  if (isAt(last, 90.0) || isAt(last, 180.0)) {
    web.mirror(180.0);
  } else if (last < 180.0) {
    return false;
  } else if (!isAt(last, 360.0)) {
    warnings.push_back("horizontal angles end at " + std::to_string(last) + "; taken to go on to 360");
    web.close();
  }
  return true;
}

/// Types A and B: what begins at 0 is the same on both sides.
bool completeSides(std::vector<double>& angles, std::vector<std::size_t>& rows) {
  if (angles.size() < 2 || !(angles.back() > 0.0)) return false;
  if (!isAt(angles.front(), 0.0)) return angles.front() < 0.0;
  std::vector<double> all;
  std::vector<std::size_t> of;
  for (std::size_t i = angles.size(); i-- > 1;) {
    all.push_back(-angles[i]);
    of.push_back(rows[i]);
  }
  all.insert(all.end(), angles.begin(), angles.end());
  of.insert(of.end(), rows.begin(), rows.end());
  angles = std::move(all);
  rows = std::move(of);
  return true;
}

std::vector<std::size_t> upTo(std::size_t count) {
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(i);
  return numbers;
}

/// As longitudes and latitudes about the axis of the type: of A the horizontal and the vertical angle, of B the
/// vertical one, the other way round, and the horizontal one. `candela`: by horizontal angle, then vertical.
WebColumns turned(bool is_b, const std::vector<double>& horizontal, const std::vector<double>& vertical,
                  const std::function<float(std::size_t, std::size_t)>& candela) {
  const auto& longitudes = is_b ? vertical : horizontal;
  const auto& latitudes = is_b ? horizontal : vertical;
  WebColumns web;
  for (auto l = latitudes.rbegin(); l != latitudes.rend(); ++l) web.polar.push_back(static_cast<float>(90.0 - *l));
  for (std::size_t i = 0; i < longitudes.size(); ++i) {
    const auto column = is_b ? longitudes.size() - 1 - i : i;
    WebColumns::Column made{is_b ? -longitudes[column] : longitudes[column], {}};
    for (std::size_t l = latitudes.size(); l-- > 0;)
      made.candela.push_back(is_b ? candela(l, column) : candela(column, l));
    web.columns.push_back(std::move(made));
  }
  return web;
}

class IesFile {
 public:
  IesFile(std::string_view text, const std::string& where) : lines_(text), where_(where), numbers_(lines_, where_) {}

  Result<PhotometricFile> read() {
    const auto head = readHead(lines_, where_);
    if (!head) return tl::unexpected(head.error());
    if (head->tilt == "INCLUDE") {
      if (const auto done = skipTilt(numbers_, file_.warnings); !done) return tl::unexpected(done.error());
    } else if (head->tilt != "NONE") {
      return fail(ErrorCode::kUnsupported,
                  atLine(lines_.number()) + "TILT is in another file; only NONE and INCLUDE are read", where_);
    }
    const bool of_2002 = head->version.find("LM-63-2002") != std::string_view::npos ||
                         head->version.find("LM-63-2019") != std::string_view::npos;
    const auto photometry = readPhotometry(numbers_, of_2002);
    if (!photometry) return tl::unexpected(photometry.error());
    photometry_ = *photometry;
    if (const auto done = readWeb(); !done) return tl::unexpected(done.error());
    if (!numbers_.atEnd()) file_.warnings.push_back(atLine(lines_.number()) + "what follows the candela is ignored");
    // Luminaires swallow a part of what their lamps send, and lamps of -1 lumens are not told.
    const double stated = photometry_.lamps * photometry_.lumens;
    if (!(photometry_.lumens > 0.0)) return std::move(file_);
    const auto sends = "its web sends " + lumensText(file_.web.lumens) + ", ";
    if (file_.web.lumens > (1.0 + kLumensOff) * stated)
      file_.warnings.push_back(sends + "more than the " + lumensText(stated) + " of its lamps");
    if (file_.web.lumens > 0.0 && file_.web.lumens < kLeastShare * stated)
      file_.warnings.push_back(sends + "less than a tenth of the " + lumensText(stated) + " of its lamps");
    return std::move(file_);
  }

 private:
  Result<void> readWeb() {
    const bool is_c = photometry_.type == 1;
    auto vertical = numbers_.ascending("vertical angles", photometry_.vertical, is_c ? 0 : -90, is_c ? 180 : 90);
    if (!vertical) return tl::unexpected(vertical.error());
    auto horizontal = numbers_.ascending("horizontal angles", photometry_.horizontal, is_c ? 0 : -90, is_c ? 360 : 90);
    if (!horizontal) return tl::unexpected(horizontal.error());
    if (const auto read = readCandela(); !read) return read;
    if (!is_c) return turnWeb(*horizontal, *vertical);
    WebColumns web;
    for (const double angle : *vertical) web.polar.push_back(static_cast<float>(angle));
    for (std::size_t h = 0; h < horizontal->size(); ++h) {
      const auto first = candela_.begin() + static_cast<std::ptrdiff_t>(h * photometry_.vertical);
      web.columns.push_back({(*horizontal)[h], {first, first + static_cast<std::ptrdiff_t>(photometry_.vertical)}});
    }
    if (!completeTurns(web, file_.warnings))
      return numbers_.bad("horizontal angles must go from 0 to 90, 180 or 360, from 90 to 270, or be 0 alone");
    file_.web = web.web();
    return {};
  }

  Result<void> turnWeb(std::vector<double>& horizontal, std::vector<double>& vertical) {
    auto columns = upTo(horizontal.size()), rows = upTo(vertical.size());
    tellOfSides(horizontal, vertical);
    if (!completeSides(horizontal, columns) || !completeSides(vertical, rows))
      return numbers_.bad("angles of types A and B must begin at 0 or below and end above 0");
    const bool is_b = photometry_.type == 2;
    file_.frame = is_b ? WebFrame::kB : WebFrame::kA;
    file_.web = turned(is_b, horizontal, vertical, [&](std::size_t h, std::size_t v) {
                  return candela_[columns[h] * photometry_.vertical + rows[v]];
                }).web();
    return {};
  }

  /// Programs differ on vertical angles from 0; LM-63 wants types A and B to go on to 90.
  void tellOfSides(const std::vector<double>& horizontal, const std::vector<double>& vertical) {
    if (isAt(vertical.front(), 0.0))
      file_.warnings.emplace_back("its vertical angles begin at 0; it is taken to shine alike below and above");
    const auto isShort = [](const std::vector<double>& angles) {
      const bool is_whole = isAt(angles.front(), 0.0) || isAt(angles.front(), -90.0);
      return !is_whole || !isAt(angles.back(), 90.0);
    };
    if (isShort(horizontal) || isShort(vertical))
      file_.warnings.emplace_back("its angles do not go to 90; it is dark beyond them");
  }

  Result<void> readCandela() {
    const std::size_t count = photometry_.vertical * photometry_.horizontal;
    for (std::size_t i = 0; i < count; ++i) {
      const auto value = numbers_.within("candela", 0, 1e12);
      if (!value) return tl::unexpected(value.error());
      const double candela = *value * photometry_.factor;
      if (!(candela <= 1e12)) return numbers_.bad("candela times its multiplier is above 1e12");
      candela_.push_back(static_cast<float>(candela));
    }
    return {};
  }

  FileLines lines_;
  const std::string& where_;
  Numbers numbers_;
  Photometry photometry_;
  std::vector<float> candela_;
  PhotometricFile file_;
};

}  // namespace

Result<PhotometricFile> parseIes(std::string_view text, const std::string& where) {
  return IesFile(text, where).read();
}

}  // namespace radiosity::scene
