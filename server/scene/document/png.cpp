#include "server/scene/document/png.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <new>
#include <string_view>
#include <vector>

#include "common/check.h"
#include "common/parallel.h"

namespace radiosity::scene {
namespace {

/// Filtered bytes that are compressed by themselves, a few milliseconds' work; matches across bands are worth less than
/// a thousandth.
constexpr std::size_t kBandBytes = std::size_t{256} << 10;
constexpr int kFilters = 5;
constexpr int kDeflateLevel = 6;
constexpr int kRawDeflate = -15, kMemoryLevel = 8;  ///< windowBits without a zlib header, as zlib.h has them

/// Filter type 4 of the specification, section 9.4.
int paeth(int left, int above, int corner) {
  const int estimate = left + above - corner;
  const int to_left = std::abs(estimate - left), to_above = std::abs(estimate - above);
  const int to_corner = std::abs(estimate - corner);
  if (to_left <= to_above && to_left <= to_corner) return left;
  return to_above <= to_corner ? above : corner;
}

/// Rows of the picture that follow each other, filtered and compressed.
class Band {
 public:
  Band(std::span<const std::uint8_t> pixels, std::size_t row_bytes, std::size_t channels)
      : pixels_(pixels), row_bytes_(row_bytes), channels_(channels), zeros_(row_bytes, 0) {
    for (auto& row : tried_) row.resize(row_bytes + 1);
  }

  void filter(std::size_t first_row, std::size_t end_row) {
    for (std::size_t y = first_row; y < end_row; ++y) {
      const auto row = pixels_.subspan(y * row_bytes_, row_bytes_);
      const auto above = y > 0 ? pixels_.subspan((y - 1) * row_bytes_, row_bytes_) : std::span(zeros_);
      const auto& best = bestOf(row, above);
      filtered_.insert(filtered_.end(), best.begin(), best.end());
    }
  }

  /// A part of a raw deflate stream that ends on a whole byte.
  void compress(bool is_last) {
    z_stream stream{};
    if (deflateInit2(&stream, kDeflateLevel, Z_DEFLATED, kRawDeflate, kMemoryLevel, Z_FILTERED) != Z_OK)
      throw std::bad_alloc();
    constexpr std::size_t kFlush = 64;  // more than an empty block takes
    deflated.resize(deflateBound(&stream, filtered_.size()) + kFlush);
    stream.next_in = filtered_.data();
    stream.avail_in = static_cast<uInt>(filtered_.size());
    stream.next_out = deflated.data();
    stream.avail_out = static_cast<uInt>(deflated.size());
    const int done = deflate(&stream, is_last ? Z_FINISH : Z_SYNC_FLUSH);
    deflated.resize(stream.total_out);
    deflateEnd(&stream);
    RAD_CHECK_EQ(done, is_last ? Z_STREAM_END : Z_OK);
    checksum = adler32(1, filtered_.data(), static_cast<uInt>(filtered_.size()));
    filtered_bytes = filtered_.size();
    filtered_ = {};
    tried_ = {};
  }

  Bytes deflated;
  uLong checksum = 1;
  std::size_t filtered_bytes = 0;

 private:
  /// The filter that leaves the least sum of magnitudes, as section 12.8 advises.
  const Bytes& bestOf(std::span<const std::uint8_t> row, std::span<const std::uint8_t> above) {
    std::size_t best = 0;
    auto least = std::numeric_limits<std::uint64_t>::max();
    for (std::size_t type = 0; type < kFilters; ++type) {
      const auto sum = apply(static_cast<int>(type), row, above, tried_[type]);
      if (sum >= least) continue;
      least = sum;
      best = type;
    }
    return tried_[best];
  }

  std::uint64_t apply(int type, std::span<const std::uint8_t> row, std::span<const std::uint8_t> above,
                      Bytes& out) const {
    std::uint64_t sum = 0;
    out[0] = static_cast<std::uint8_t>(type);
    for (std::size_t i = 0; i < row.size(); ++i) {
      const int left = i >= channels_ ? row[i - channels_] : 0, corner = i >= channels_ ? above[i - channels_] : 0;
      const int up = above[i];
      const int guess = type == 1   ? left
                        : type == 2 ? up
                        : type == 3 ? (left + up) / 2
                        : type == 4 ? paeth(left, up, corner)
                                    : 0;
      out[i + 1] = static_cast<std::uint8_t>(row[i] - guess);
      sum += static_cast<std::uint64_t>(std::abs(static_cast<std::int8_t>(out[i + 1])));
    }
    return sum;
  }

  std::span<const std::uint8_t> pixels_;
  std::size_t row_bytes_, channels_;
  Bytes zeros_, filtered_;
  std::array<Bytes, kFilters> tried_;
};

void put32(Bytes& out, std::uint64_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(value >> shift));
}

void putChunk(Bytes& out, std::string_view type, std::span<const std::uint8_t> data) {
  put32(out, data.size());
  const auto begin = out.size();
  out.insert(out.end(), type.begin(), type.end());
  out.insert(out.end(), data.begin(), data.end());
  put32(out, crc32(0, out.data() + begin, static_cast<uInt>(out.size() - begin)));
}

Bytes headerOf(int width, int height, int channels) {
  constexpr std::uint8_t kRgb = 2, kRgba = 6, kBits = 8;
  Bytes header;
  put32(header, static_cast<std::uint64_t>(width));
  put32(header, static_cast<std::uint64_t>(height));
  for (const auto byte : {kBits, channels == 4 ? kRgba : kRgb, std::uint8_t{0}, std::uint8_t{0}, std::uint8_t{0}})
    header.push_back(byte);
  return header;
}

}  // namespace

Bytes encodePng(int width, int height, int channels, std::span<const std::uint8_t> pixels) {
  const auto rows = static_cast<std::size_t>(height), depth = static_cast<std::size_t>(channels);
  const auto row_bytes = static_cast<std::size_t>(width) * depth;
  RAD_CHECK_EQ(pixels.size(), rows * row_bytes);
  const auto band_rows = std::max<std::size_t>(1, kBandBytes / (row_bytes + 1));
  std::vector<Band> bands((rows + band_rows - 1) / band_rows, Band({}, 0, 0));
  inTurns(bands.size(), [&](std::size_t i) {
    Band band(pixels, row_bytes, depth);
    band.filter(i * band_rows, std::min((i + 1) * band_rows, rows));
    band.compress(i + 1 == bands.size());
    bands[i] = std::move(band);
  });
  Bytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  putChunk(png, "IHDR", headerOf(width, height, channels));
  constexpr std::array<std::uint8_t, 2> kZlibHeader{0x78, 0x9c};
  putChunk(png, "IDAT", kZlibHeader);
  uLong checksum = adler32(0, nullptr, 0);
  for (const auto& band : bands) {
    putChunk(png, "IDAT", band.deflated);
    checksum = adler32_combine(checksum, band.checksum, static_cast<z_off_t>(band.filtered_bytes));
  }
  Bytes end;
  put32(end, checksum);
  putChunk(png, "IDAT", end);
  putChunk(png, "IEND", {});
  return png;
}

}  // namespace radiosity::scene
