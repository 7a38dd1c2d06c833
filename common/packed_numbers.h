// Many whole numbers that are all below some bound, in no more bytes each than that takes. Plain values; any number of
// threads may read, and set different ones.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <vector>

namespace radiosity {

class PackedNumbers {
 public:
  PackedNumbers() = default;
  /// So many, which may be any number up to `most`; each is most() at first. Throws std::bad_alloc.
  PackedNumbers(std::size_t count, std::uint32_t most)
      : count_(count), width_(widthFor(most)), bytes_(count * width_ + sizeof(std::uint32_t), 0xFF) {}

  /// Bytes of each: two at least.
  [[nodiscard]] static std::size_t widthFor(std::uint32_t most) {
    return most <= 0xFFFF ? 2 : most <= 0xFF'FFFF ? 3 : 4;
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::size_t width() const { return width_; }
  /// The largest that fits.
  [[nodiscard]] std::uint32_t most() const { return maskOf(width_); }
  [[nodiscard]] std::size_t bytes() const { return bytes_.size(); }

  /// Also while others are set.
  [[nodiscard]] std::uint32_t operator[](std::size_t i) const {
    const auto* byte = bytes_.data() + i * width_;
    std::uint32_t number = byte[0] | std::uint32_t{byte[1]} << 8;
    if (width_ > 2) number |= std::uint32_t{byte[2]} << 16;
    if (width_ > 3) number |= std::uint32_t{byte[3]} << 24;
    return number;
  }
  void set(std::size_t i, std::uint32_t number) {
    auto* byte = bytes_.data() + i * width_;
    byte[0] = static_cast<std::uint8_t>(number);
    byte[1] = static_cast<std::uint8_t>(number >> 8);
    if (width_ > 2) byte[2] = static_cast<std::uint8_t>(number >> 16);
    if (width_ > 3) byte[3] = static_cast<std::uint8_t>(number >> 24);
  }

  /// Some in a row, read faster, while none is set.
  class Run {
   public:
    class Iterator {
     public:
      using difference_type = std::ptrdiff_t;
      using value_type = std::uint32_t;
      Iterator() = default;
      Iterator(const std::uint8_t* at, std::size_t width) : at_(at), width_(width), mask_(maskOf(width)) {}
      std::uint32_t operator*() const { return at(at_, mask_); }
      Iterator& operator++() {
        at_ += width_;
        return *this;
      }
      Iterator operator++(int) {
        const auto before = *this;
        ++*this;
        return before;
      }
      bool operator==(const Iterator& other) const { return at_ == other.at_; }

     private:
      const std::uint8_t* at_ = nullptr;
      std::size_t width_ = 0;
      std::uint32_t mask_ = 0;
    };
    Run(const PackedNumbers& of, std::size_t first, std::size_t count)
        : from_(of.bytes_.data() + first * of.width_), width_(of.width_), count_(count) {}
    [[nodiscard]] Iterator begin() const { return {from_, width_}; }
    [[nodiscard]] Iterator end() const { return {from_ + count_ * width_, width_}; }
    [[nodiscard]] std::size_t size() const { return count_; }
    [[nodiscard]] std::uint32_t operator[](std::size_t i) const { return at(from_ + i * width_, maskOf(width_)); }

   private:
    const std::uint8_t* from_;
    std::size_t width_, count_;
  };
  [[nodiscard]] Run run(std::size_t first, std::size_t count) const { return {*this, first, count}; }
  [[nodiscard]] Run all() const { return {*this, 0, count_}; }

 private:
  [[nodiscard]] static std::uint32_t maskOf(std::size_t width) { return 0xFFFF'FFFFU >> (32 - 8 * width); }
  /// The first byte is the lowest; four are always there.
  [[nodiscard]] static std::uint32_t at(const std::uint8_t* bytes, std::uint32_t mask) {
    std::uint32_t word = 0;
    std::memcpy(&word, bytes, sizeof(word));
    return (std::endian::native == std::endian::big ? __builtin_bswap32(word) : word) & mask;
  }

  std::size_t count_ = 0, width_ = 2;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace radiosity
