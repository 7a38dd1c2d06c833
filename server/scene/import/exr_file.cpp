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
#include <cmath>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/task.h"
#include "server/scene/import/sky_file.h"

namespace radiosity::scene {
namespace {

/// Of a header; a lot for attributes that are read.
constexpr std::size_t kMostHeader = std::size_t{1} << 20U, kMostChannels = 64;
/// Lines that are packed together, or a row of tiles, are held at once: bytes.
constexpr std::uint64_t kMostBlock = std::uint64_t{1} << 26U;
/// Of the version: parts of the format that are read are scan lines and tiles; names may be long.
constexpr std::uint32_t kTiled = 0x200, kLongNames = 0x400, kVersion = 2;

/// A file in memory, of which the first bytes are others.
class MemoryFile : public Imf::IStream {
 public:
  MemoryFile(std::span<const std::uint8_t> head, std::span<const std::uint8_t> bytes)
      : Imf::IStream("sky"), head_(head), bytes_(bytes) {}

  bool read(char into[], int count) override {
    const auto wanted = static_cast<std::size_t>(std::max(0, count));
    if (at_ > bytes_.size() || wanted > bytes_.size() - at_) throw std::runtime_error("it ends early");
    const auto of_head = at_ < head_.size() ? std::min(wanted, head_.size() - at_) : 0;
    if (of_head > 0) std::memcpy(into, head_.data() + at_, of_head);
    if (of_head < wanted) std::memcpy(into + of_head, bytes_.data() + at_ + of_head, wanted - of_head);
    at_ += wanted;
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t to) override { at_ = to; }

 private:
  std::span<const std::uint8_t> head_, bytes_;
  std::size_t at_ = 0;
};

/// An attribute that decides what is read, and how much memory that takes.
struct Needed {
  std::string_view name, type;
  std::size_t size;  ///< bytes; 0: any
};
constexpr std::array<Needed, 12> kNeeded{{{"channels", "chlist", 0},
                                          {"compression", "compression", 1},
                                          {"dataWindow", "box2i", 16},
                                          {"displayWindow", "box2i", 16},
                                          {"lineOrder", "lineOrder", 1},
                                          {"pixelAspectRatio", "float", 4},
                                          {"screenWindowCenter", "v2f", 8},
                                          {"screenWindowWidth", "float", 4},
                                          {"tiles", "tiledesc", 9},
                                          {"type", "string", 0},
                                          {"envmap", "envmap", 1},
                                          {"whiteLuminance", "float", 4}}};

/// A header as the library is to read it, looked at before. Attributes of other names get a type that nobody knows,
/// which the library skips by their size: by those it knows it reads, and allocates, whatever their content claims.
class ExrHeader {
 public:
  explicit ExrHeader(std::span<const std::uint8_t> bytes)
      : bytes_(bytes),
        rest_(bytes),
        head_(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(std::min(bytes.size(), kMostHeader))) {}

  /// Empty: the library may read the file with head() as its first bytes.
  std::string fault() {
    std::uint32_t magic = 0, version = 0;
    if (!take(magic) || !take(version)) return "it ends early";
    if ((version & 0xFFU) != kVersion || (version & ~(0xFFU | kTiled | kLongNames)) != 0)
      return "only pictures of one part are read, by lines or tiles";
    while (true) {
      std::string name, type;
      std::int32_t size = 0;
      if (!text(name)) return "it ends early";
      if (name.empty()) return sizeFault();
      const auto type_at = at();
      if (!text(type) || !take(size) || size < 0 || static_cast<std::size_t>(size) > rest_.size())
        return "it ends early";
      const auto value = rest_.first(static_cast<std::size_t>(size));
      rest_ = rest_.subspan(value.size());
      if (at() > kMostHeader) return "its header is too long";
      if (auto what = attribute(name, type, value, type_at); !what.empty()) return what;
    }
  }
  [[nodiscard]] std::span<const std::uint8_t> head() const { return head_; }
  /// Nits of what has the number 1.
  [[nodiscard]] float white() const { return white_; }

 private:
  template <typename T>
  bool take(T& value) {
    if (rest_.size() < sizeof(T)) return false;
    std::memcpy(&value, rest_.data(), sizeof(T));
    rest_ = rest_.subspan(sizeof(T));
    return true;
  }
  [[nodiscard]] std::size_t at() const { return bytes_.size() - rest_.size(); }
  bool text(std::string& into) {
    constexpr std::size_t kMostName = 255;
    const auto within = rest_.first(std::min(rest_.size(), kMostName + 1));
    const auto end = std::ranges::find(within, std::uint8_t{0});
    if (end == within.end()) return false;
    into.assign(within.begin(), end);
    rest_ = rest_.subspan(into.size() + 1);
    return true;
  }

  std::string attribute(const std::string& name, const std::string& type, std::span<const std::uint8_t> value,
                        std::size_t type_at) {
    const auto needed = std::ranges::find(kNeeded, name, &Needed::name);
    if (needed == kNeeded.end()) {
      std::fill_n(head_.begin() + static_cast<std::ptrdiff_t>(type_at), type.size(), std::uint8_t{'?'});
      return {};
    }
    auto& is_met = met_[static_cast<std::size_t>(needed - kNeeded.begin())];
    if (is_met || type != needed->type || (needed->size > 0 && value.size() != needed->size))
      return "its header has " + name + " twice, or not as " + std::string(needed->type);
    is_met = true;
    if (name == "channels") return channels(value);
    if (name == "compression") return compression(value[0]);
    if (name == "dataWindow") std::memcpy(window_.data(), value.data(), sizeof(window_));
    if (name == "tiles") std::memcpy(tile_.data(), value.data(), sizeof(tile_));
    if (name == "whiteLuminance") std::memcpy(&white_, value.data(), sizeof(white_));
    if (name == "whiteLuminance" && !(white_ > 0.0F && white_ <= kMostSkyNits)) return "whiteLuminance must be above 0";
    if (name == "envmap" && value[0] != 0) return "it is a cube; equirectangular pictures (latlong) are read";
    return {};
  }

  /// A list of names, each with its type (4 bytes), a flag (4), and how far apart its pixels are (8).
  std::string channels(std::span<const std::uint8_t> value) {
    constexpr std::size_t kAfterName = 16;
    constexpr std::array<std::uint64_t, 3> kBytes{4, 2, 4};
    for (std::size_t count = 0; !value.empty(); ++count) {
      const auto end = std::ranges::find(value, std::uint8_t{0});
      const auto length = static_cast<std::size_t>(end - value.begin());
      if (length == 0 && value.size() == 1) return {};
      if (end == value.end() || length == 0 || value.size() - length - 1 < kAfterName) break;
      if (count == kMostChannels) return "it has more than " + std::to_string(kMostChannels) + " channels";
      std::uint32_t type = 0;
      std::memcpy(&type, value.data() + length + 1, sizeof(type));
      if (type >= kBytes.size()) break;
      pixel_bytes_ += kBytes[type];
      value = value.subspan(length + 1 + kAfterName);
    }
    return "its list of channels is broken";
  }

  /// How many lines are packed together.
  std::string compression(std::uint8_t method) {
    constexpr std::array<std::uint64_t, 10> kLines{1, 1, 1, 16, 32, 16, 32, 32, 32, 256};
    if (method >= kLines.size()) return "its compression is none that is known";
    lines_ = kLines[method];
    return {};
  }

  [[nodiscard]] std::string sizeFault() const {
    const auto columns = std::int64_t{window_[2]} - window_[0] + 1, rows = std::int64_t{window_[3]} - window_[1] + 1;
    if (columns < 1 || rows < 1) return "its data window has no pixels";
    if (auto fault = skySizeFault(static_cast<std::uint64_t>(columns), static_cast<std::uint64_t>(rows));
        !fault.empty())
      return fault;
    if (tile_[0] > kMostSkyColumns || tile_[1] > kMostSkyRows) return "its tiles are too large";
    const auto width = static_cast<std::uint64_t>(columns) + tile_[0];
    if (width * std::max<std::uint64_t>(tile_[1], lines_) * pixel_bytes_ > kMostBlock)
      return "its tiles, or lines that are packed together, take more than 64 MiB";
    return {};
  }

  std::span<const std::uint8_t> bytes_, rest_;
  std::vector<std::uint8_t> head_;
  std::array<bool, kNeeded.size()> met_{};
  std::array<std::int32_t, 4> window_{0, 0, -1, -1};
  std::array<std::uint32_t, 2> tile_{0, 0};
  std::uint64_t pixel_bytes_ = 0, lines_ = 1;
  float white_ = 1.0F;
};

/// Numbers that are no light and yet are usual: filters ring below 0, and a sun is beyond what halves have.
class OddPixels {
 public:
  void mend(std::span<glm::vec3> row) {
    constexpr float kLargestHalf = 65'504.0F;
    for (auto& pixel : row) {
      const auto before = pixel;
      for (int c = 0; c < 3; ++c)
        if (pixel[c] == HUGE_VALF) pixel[c] = kLargestHalf;
      if (pixel != before) ++endless_;
      const bool is_below = pixel.x < 0.0F || pixel.y < 0.0F || pixel.z < 0.0F;
      if (!is_below) continue;
      ++below_;
      for (int c = 0; c < 3; ++c)
        if (pixel[c] < 0.0F) pixel[c] = 0.0F;
    }
  }
  void tell(std::vector<std::string>* warnings) const {
    if (warnings == nullptr) return;
    if (below_ > 0) warnings->push_back(std::to_string(below_) + " pixels have numbers below 0, which count as 0");
    if (endless_ > 0)
      warnings->push_back(std::to_string(endless_) + " pixels have infinite numbers, which count as 65504");
  }

 private:
  std::uint64_t below_ = 0, endless_ = 0;
};

/// Throws what the library does.
Result<SkyImage> readPixels(std::span<const std::uint8_t> bytes, const ExrHeader& header, const std::string& where,
                            std::vector<std::string>* warnings) {
  MemoryFile memory(header.head(), bytes);
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
  OddPixels odd;
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
    odd.mend(row);
    for (auto& pixel : row) pixel *= header.white();
    if (auto fault = skyRowFault(row, y); !fault.empty()) return fail(ErrorCode::kInvalidScene, fault, where);
    maker.addRow(row);
  }
  odd.tell(warnings);
  return maker.take();
}

}  // namespace

Result<SkyImage> readExr(std::span<const std::uint8_t> bytes, const std::string& where,
                         std::vector<std::string>* warnings) {
  ExrHeader header(bytes);
  if (auto fault = header.fault(); !fault.empty()) {
    const bool is_large = fault.find("may have") != std::string::npos;
    return fail(is_large ? ErrorCode::kTooLarge : ErrorCode::kInvalidScene, fault, where);
  }
  try {
    return readPixels(bytes, header, where, warnings);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInvalidScene, std::string("is no picture that OpenEXR reads: ") + error.what(), where);
  }
}

}  // namespace radiosity::scene
