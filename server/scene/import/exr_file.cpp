// OpenEXR, by its own library, once the header was looked at: the library allocates what a header claims.
#include <ImathBox.h>
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfTestFile.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/task.h"
#include "server/scene/import/sky_file.h"

namespace radiosity::scene {
namespace {

/// Of a header; a lot for attributes that are read.
constexpr std::size_t kMostHeader = std::size_t{1} << 20U, kMostChannels = 64;
/// Tiles with more texels, or a row of tiles that has, would be held at once.
constexpr std::uint64_t kMostTileTexels = std::uint64_t{1} << 24U;
/// Of the version: parts of the format that are read are scan lines and tiles; names may be long.
constexpr std::uint32_t kTiled = 0x200, kLongNames = 0x400, kVersion = 2;

/// A file in memory.
class MemoryFile : public Imf::IStream {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes) : Imf::IStream("sky"), bytes_(bytes) {}

  bool read(char into[], int count) override {
    const auto wanted = static_cast<std::uint64_t>(std::max(0, count));
    if (at_ > bytes_.size() || wanted > bytes_.size() - at_) throw std::runtime_error("it ends early");
    std::memcpy(into, bytes_.data() + at_, wanted);
    at_ += wanted;
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t to) override { at_ = to; }

 private:
  std::span<const std::uint8_t> bytes_;
  std::uint64_t at_ = 0;
};

/// What of a header decides how much memory is taken.
class HeaderCheck {
 public:
  explicit HeaderCheck(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  /// Empty: the library may read it.
  std::string fault() {
    std::uint32_t magic = 0, version = 0;
    if (!take(magic) || !take(version)) return "it ends early";
    if ((version & 0xFFU) != kVersion || (version & ~(0xFFU | kTiled | kLongNames)) != 0)
      return "only pictures of one part are read, by lines or tiles";
    for (std::size_t taken = 0; taken < kMostHeader;) {
      const auto before = rest_.size();
      std::string name, type;
      std::int32_t size = 0;
      if (!text(name)) return "it ends early";
      if (name.empty()) return sizeFault();
      if (!text(type) || !take(size) || size < 0 || static_cast<std::size_t>(size) > rest_.size())
        return "it ends early";
      attribute(name, rest_.first(static_cast<std::size_t>(size)));
      rest_ = rest_.subspan(static_cast<std::size_t>(size));
      taken += before - rest_.size();
    }
    return "its header is too long";
  }

 private:
  template <typename T>
  bool take(T& value) {
    if (rest_.size() < sizeof(T)) return false;
    std::memcpy(&value, rest_.data(), sizeof(T));
    rest_ = rest_.subspan(sizeof(T));
    return true;
  }
  bool text(std::string& into) {
    constexpr std::size_t kMostName = 255;
    const auto within = rest_.first(std::min(rest_.size(), kMostName + 1));
    const auto end = std::ranges::find(within, std::uint8_t{0});
    if (end == within.end()) return false;
    into.assign(within.begin(), end);
    rest_ = rest_.subspan(into.size() + 1);
    return true;
  }
  void attribute(const std::string& name, std::span<const std::uint8_t> value) {
    if (name == "dataWindow" && value.size() == sizeof(window_))
      std::memcpy(window_.data(), value.data(), value.size());
    if (name == "tiles" && value.size() >= sizeof(tile_)) std::memcpy(tile_.data(), value.data(), sizeof(tile_));
    constexpr std::size_t kLeastChannel = 18;
    if (name == "channels") many_channels_ = value.size() > kMostChannels * (kLeastChannel + 32);
  }
  [[nodiscard]] std::string sizeFault() const {
    const auto columns = std::int64_t{window_[2]} - window_[0] + 1, rows = std::int64_t{window_[3]} - window_[1] + 1;
    if (columns < 1 || rows < 1) return "its data window has no pixels";
    if (auto fault = skySizeFault(static_cast<std::uint64_t>(columns), static_cast<std::uint64_t>(rows));
        !fault.empty())
      return fault;
    if (many_channels_) return "it has more than " + std::to_string(kMostChannels) + " channels";
    const auto width = std::max<std::uint64_t>(tile_[0], static_cast<std::uint64_t>(columns));
    if (tile_[0] > kMostSkyColumns || width * tile_[1] > kMostTileTexels) return "its tiles are too large";
    return {};
  }

  std::span<const std::uint8_t> rest_;
  std::array<std::int32_t, 4> window_{0, 0, -1, -1};
  std::array<std::uint32_t, 2> tile_{0, 0};
  bool many_channels_ = false;
};

/// Throws what the library does.
Result<SkyImage> readPixels(std::span<const std::uint8_t> bytes, const std::string& where) {
  MemoryFile memory(bytes);
  Imf::InputFile file(memory, 0);
  const auto& channels = file.header().channels();
  const bool has_colour = channels.findChannel("R") != nullptr && channels.findChannel("G") != nullptr &&
                          channels.findChannel("B") != nullptr;
  const bool is_grey = !has_colour && channels.findChannel("Y") != nullptr && channels.findChannel("RY") == nullptr;
  if (!has_colour && !is_grey) return fail(ErrorCode::kUnsupported, "it has neither channels R, G and B nor Y", where);
  for (const char* name : {"R", "G", "B", "Y"}) {
    const auto* channel = channels.findChannel(name);
    if (channel != nullptr && (channel->xSampling != 1 || channel->ySampling != 1))
      return fail(ErrorCode::kUnsupported, "its channels have fewer pixels than the picture", where);
  }
  const auto window = file.header().dataWindow();
  const auto columns = static_cast<std::size_t>(window.max.x - window.min.x + 1);
  const auto rows = static_cast<std::size_t>(window.max.y - window.min.y + 1);
  SkyImageMaker maker(columns, rows);
  std::vector<glm::vec3> row(columns);
  // The first pixel of a line; pixel x of line y is at base + x * step, for each line.
  const auto slice = [&](int c) {
    auto* base = reinterpret_cast<char*>(&row[0][c]) -
                 static_cast<std::ptrdiff_t>(window.min.x) * static_cast<std::ptrdiff_t>(sizeof(glm::vec3));
    return Imf::Slice(Imf::FLOAT, base, sizeof(glm::vec3), 0);
  };
  Imf::FrameBuffer buffer;
  for (int c = 0; c < (is_grey ? 1 : 3); ++c) buffer.insert(is_grey ? "Y" : std::string(1, "RGB"[c]).c_str(), slice(c));
  file.setFrameBuffer(buffer);
  for (std::size_t y = 0; y < rows; ++y) {
    interruptionPoint();
    file.readPixels(window.min.y + static_cast<int>(y));
    if (is_grey)
      for (auto& pixel : row) pixel = glm::vec3(pixel.x);
    if (auto fault = skyRowFault(row, y); !fault.empty()) return fail(ErrorCode::kInvalidScene, fault, where);
    maker.addRow(row);
  }
  return maker.take();
}

}  // namespace

Result<SkyImage> readExr(std::span<const std::uint8_t> bytes, const std::string& where) {
  if (auto fault = HeaderCheck(bytes).fault(); !fault.empty()) {
    const bool is_large = fault.find("may have") != std::string::npos;
    return fail(is_large ? ErrorCode::kTooLarge : ErrorCode::kInvalidScene, fault, where);
  }
  try {
    return readPixels(bytes, where);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInvalidScene, std::string("is no picture that OpenEXR reads: ") + error.what(), where);
  }
}

}  // namespace radiosity::scene
