#include "server/scene/import/photometric_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

namespace radiosity::scene {
namespace {

constexpr double kMostValue = 1e12;
constexpr std::string_view kBlank = " \t\v\f";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

}  // namespace

std::optional<std::string_view> FileLines::next() {
  if (rest_.empty()) return std::nullopt;
  ++number_;
  const auto end = rest_.find_first_of("\r\n");
  const auto line = rest_.substr(0, end);
  rest_.remove_prefix(std::min(line.size(), rest_.size()));
  const bool both = rest_.starts_with("\r\n");
  rest_.remove_prefix(std::min<std::size_t>(both ? 2 : 1, rest_.size()));
  return trimmed(line);
}

std::optional<double> photometricNumber(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0.0;
  const auto* end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || read != end || !(std::abs(value) <= kMostValue)) return std::nullopt;
  return value;
}

WebAxes webAxes(WebFrame frame) {
  const glm::dvec3 x(1, 0, 0), down(0, -1, 0), ahead(0, 0, -1);
  if (frame == WebFrame::kA) return {x, ahead};
  return frame == WebFrame::kB ? WebAxes{down, ahead} : WebAxes{ahead, x};
}

std::string atLine(std::size_t line) { return "line " + std::to_string(line) + ": "; }

std::string lumensText(double lumens) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g lm", lumens);
  return text.data();
}

void WebColumns::mirror(double about) {
  const auto count = static_cast<std::ptrdiff_t>(columns.size());
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    const auto& column = columns[static_cast<std::size_t>(i)];
    const double image = 2.0 * about - column.azimuth;
    const auto told = columns.begin() + count;
    const auto near = std::ranges::upper_bound(columns.begin(), told, image - kLeastAngle, {}, &Column::azimuth);
    if (near == told || near->azimuth >= image + kLeastAngle) columns.push_back({image, std::vector(column.candela)});
  }
  std::ranges::sort(columns, {}, &Column::azimuth);
}

void WebColumns::close() {
  if (columns.size() > 1 && columns.back().azimuth < columns.front().azimuth + 360.0 - kLeastAngle)
    columns.push_back({columns.front().azimuth + 360.0, columns.front().candela});
}

LightWeb WebColumns::web() const {
  std::vector<float> azimuth, candela;
  for (const auto& column : columns) {
    azimuth.push_back(static_cast<float>(column.azimuth));
    candela.insert(candela.end(), column.candela.begin(), column.candela.end());
  }
  return LightWeb::of(polar, azimuth, candela);
}

Result<PhotometricFile> parsePhotometricFile(std::span<const std::uint8_t> bytes, const std::string& where) {
  if (bytes.size() > kMostPhotometricBytes)
    return fail(ErrorCode::kTooLarge, "a photometric file has more than 16 MiB", where);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  while (text.ends_with('\x1a') || text.ends_with('\0')) text.remove_suffix(1);  // of DOS, and what fills a buffer view
  if (text.find('\0') != std::string_view::npos)
    return fail(ErrorCode::kInvalidScene, "is neither an IES nor a EULUMDAT file: it is no text", where);
  const bool is_ies = text.starts_with("IESNA") || text.starts_with("IES:LM") || text.find("TILT=") != text.npos;
  auto file = is_ies ? parseIes(text, where) : parseEulumdat(text, where);
  if (!file) return file;
  if (!isWebTable(file->web.table)) {
    const auto most = std::to_string(kMostWebCandela);
    return fail(ErrorCode::kTooLarge, "its symmetries written out, it has more than " + most + " directions", where);
  }
  if (!std::isfinite(file->web.lumens)) return fail(ErrorCode::kInvalidScene, "its light is no number", where);
  return file;
}

}  // namespace radiosity::scene
