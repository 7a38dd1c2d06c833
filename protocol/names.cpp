#include <array>
#include <utility>

#include "protocol/messages.h"

namespace radiosity::protocol {
namespace {

template <typename T, std::size_t N>
using Names = std::array<std::pair<T, std::string_view>, N>;

constexpr Names<PixelFormat, 4> kFormats{{{PixelFormat::kRgba16f, "rgba16f"},
                                          {PixelFormat::kRgb9e5, "rgb9e5"},
                                          {PixelFormat::kRgba32f, "rgba32f"},
                                          {PixelFormat::kR32ui, "r32ui"}}};
constexpr Names<Codec, 2> kCodecs{{{Codec::kNone, "none"}, {Codec::kDeflate, "deflate"}}};
constexpr Names<Quantity, 7> kQuantities{{{Quantity::kIrradiance, "irradiance"},
                                          {Quantity::kRadiosity, "radiosity"},
                                          {Quantity::kError, "error"},
                                          {Quantity::kPatchId, "patchId"},
                                          {Quantity::kMipLevel, "mipLevel"},
                                          {Quantity::kUnshot, "unshot"},
                                          {Quantity::kNormal, "normal"}}};

template <typename T, std::size_t N>
std::string_view nameIn(const Names<T, N>& names, T value) {
  for (const auto& [key, text] : names)
    if (key == value) return text;
  return "unknown";
}

template <typename T, std::size_t N>
std::optional<T> valueIn(const Names<T, N>& names, std::string_view text) {
  for (const auto& [key, known] : names)
    if (known == text) return key;
  return std::nullopt;
}

}  // namespace

std::string_view name(PixelFormat format) { return nameIn(kFormats, format); }
std::string_view name(Codec codec) { return nameIn(kCodecs, codec); }
std::string_view name(Quantity quantity) { return nameIn(kQuantities, quantity); }
std::optional<PixelFormat> pixelFormatFrom(std::string_view text) { return valueIn(kFormats, text); }
std::optional<Codec> codecFrom(std::string_view text) { return valueIn(kCodecs, text); }
std::optional<Quantity> quantityFrom(std::string_view text) { return valueIn(kQuantities, text); }

}  // namespace radiosity::protocol
