// Radiance HDR (Ward, "Real pixels", Graphics Gems II, 1991; the format as the Radiance manual has it).
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

#include "common/task.h"
#include "server/scene/import/sky_file.h"

namespace radiosity::scene {
namespace {

/// Headers are text; a line of one that has more is none.
constexpr std::size_t kMostLine = 4096, kMostLines = 1024;
/// Rows this wide may be packed channel by channel.
constexpr std::size_t kLeastPacked = 8, kMostPacked = 32'767;
using Rgbe = std::array<std::uint8_t, 4>;

class HdrFile {
 public:
  HdrFile(std::span<const std::uint8_t> bytes, const std::string& where) : rest_(bytes), where_(where) {}

  Result<SkyImage> read() {
    if (auto ok = readHeader(); !ok) return tl::unexpected(ok.error());
    if (auto fault = skySizeFault(columns_, rows_); !fault.empty()) return fail(ErrorCode::kTooLarge, fault, where_);
    SkyImageMaker maker(columns_, rows_);
    std::vector<Rgbe> packed(columns_);
    std::vector<glm::vec3> row(columns_);
    for (std::size_t y = 0; y < rows_; ++y) {
      interruptionPoint();
      if (!readRow(packed))
        return bad("ends, or is broken, in row " + std::to_string(y) + " of " + std::to_string(rows_));
      for (std::size_t x = 0; x < columns_; ++x) row[x] = colourOf(packed[x]);
      if (auto fault = skyRowFault(row, y); !fault.empty()) return bad(fault);
      maker.addRow(row);
    }
    return maker.take();
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(std::string what) const {
    return fail(ErrorCode::kInvalidScene, std::move(what), where_);
  }

  /// Without its end; none: there is no more.
  std::optional<std::string_view> line() {
    const auto within = rest_.first(std::min(rest_.size(), kMostLine));
    const auto end = std::ranges::find(within, std::uint8_t{'\n'});
    if (end == within.end()) return std::nullopt;
    const auto length = static_cast<std::size_t>(end - within.begin());
    std::string_view text(reinterpret_cast<const char*>(rest_.data()), length);
    rest_ = rest_.subspan(length + 1);
    if (text.ends_with('\r')) text.remove_suffix(1);
    return text;
  }

  Result<void> readHeader() {
    for (std::size_t lines = 0; lines < kMostLines; ++lines) {
      const auto text = line();
      if (!text) return bad("its header has no end");
      if (text->empty()) return readSize();
      if (text->starts_with("FORMAT=") && *text != "FORMAT=32-bit_rle_rgbe")
        return fail(ErrorCode::kUnsupported, std::string(*text) + "; only 32-bit_rle_rgbe is read", where_);
      if (text->starts_with("EXPOSURE="))
        if (auto ok = divide(*text, 9, 1); !ok) return ok;
      if (text->starts_with("COLORCORR="))
        if (auto ok = divide(*text, 10, 3); !ok) return ok;
    }
    return bad("its header has more than " + std::to_string(kMostLines) + " lines");
  }

  /// By what pixels were multiplied with: one number for all channels, or one for each.
  Result<void> divide(std::string_view line, std::size_t from, int count) {
    const std::string name(line.substr(0, from - 1));
    const auto wrong = [&] {
      return bad(name + " must be " + (count == 1 ? "a number above 0" : "three numbers above 0"));
    };
    line.remove_prefix(from);
    double number = 0.0;
    for (int c = 0; c < 3; ++c) {
      if (c < count) {
        line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
        const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
        if (error != std::errc()) return wrong();
        line.remove_prefix(static_cast<std::size_t>(end - line.data()));
      }
      exposure_[c] *= number;
      if (!(exposure_[c] > 1e-12 && exposure_[c] < 1e12)) return wrong();
    }
    return {};
  }

  /// "-Y 1024 +X 2048": rows from the top, columns from the left.
  Result<void> readSize() {
    const auto text = line();
    if (!text) return bad("it ends before its size");
    const auto number = [&](std::string_view from, std::size_t& into) {
      const auto [end, error] = std::from_chars(from.data(), text->data() + text->size(), into);
      return error == std::errc() ? end : nullptr;
    };
    const auto middle = text->find(" +X ");
    if (!text->starts_with("-Y ") || middle == std::string_view::npos)
      return fail(ErrorCode::kUnsupported, "its size is not given as '-Y rows +X columns'", where_);
    if (number(text->substr(3), rows_) != text->data() + middle ||
        number(text->substr(middle + 4), columns_) != text->data() + text->size())
      return bad("its size is no two numbers");
    return {};
  }

  bool readRow(std::span<Rgbe> row) {
    const bool is_packed = row.size() >= kLeastPacked && row.size() <= kMostPacked && rest_.size() >= 4 &&
                           rest_[0] == 2 && rest_[1] == 2 && rest_[2] < 128;
    if (!is_packed) return readFlatRow(row);
    if ((std::size_t{rest_[2]} << 8U | rest_[3]) != row.size()) return false;
    rest_ = rest_.subspan(4);
    for (std::size_t channel = 0; channel < 4; ++channel)
      if (!readChannel(row, channel)) return false;
    return true;
  }

  bool readChannel(std::span<Rgbe> row, std::size_t channel) {
    for (std::size_t x = 0; x < row.size();) {
      if (rest_.size() < 2) return false;
      const bool is_run = rest_[0] > 128;
      const std::size_t count = is_run ? rest_[0] - 128U : rest_[0];
      const std::size_t takes = is_run ? 2 : 1 + count;
      if (count == 0 || count > row.size() - x || rest_.size() < takes) return false;
      for (std::size_t i = 0; i < count; ++i) row[x++][channel] = rest_[is_run ? 1 : 1 + i];
      rest_ = rest_.subspan(takes);
    }
    return true;
  }

  /// Pixel by pixel; {1, 1, 1, n} repeats the last one n times, and of several in a row the next has the higher digits.
  bool readFlatRow(std::span<Rgbe> row) {
    unsigned shift = 0;
    for (std::size_t x = 0; x < row.size();) {
      if (rest_.size() < 4) return false;
      const Rgbe pixel{rest_[0], rest_[1], rest_[2], rest_[3]};
      rest_ = rest_.subspan(4);
      if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
        const std::size_t count = std::size_t{pixel[3]} << shift;
        if (x == 0 || shift > 16 || count > row.size() - x) return false;
        const auto last = row[x - 1];
        for (std::size_t i = 0; i < count; ++i) row[x++] = last;
        shift += 8;
      } else {
        row[x++] = pixel;
        shift = 0;
      }
    }
    return true;
  }

  /// As most programs read it: Radiance itself adds half of a mantissa's last digit, which writers cut off in the mean,
  /// and which is 2 % of what has a mantissa of 25.
  [[nodiscard]] glm::vec3 colourOf(const Rgbe& pixel) const {
    glm::vec3 colour(0.0F);
    if (pixel[3] == 0) return colour;
    const double scale = std::ldexp(1.0, int{pixel[3]} - 136);
    for (int c = 0; c < 3; ++c) {
      const auto mantissa = pixel[static_cast<std::size_t>(c)];
      colour[c] = static_cast<float>(scale * mantissa / exposure_[c]);
    }
    return colour;
  }

  std::span<const std::uint8_t> rest_;
  const std::string& where_;
  std::size_t columns_ = 0, rows_ = 0;
  glm::dvec3 exposure_{1.0};
};

}  // namespace

Result<SkyImage> readHdr(std::span<const std::uint8_t> bytes, const std::string& where) {
  return HdrFile(bytes, where).read();
}

}  // namespace radiosity::scene
