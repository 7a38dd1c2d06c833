// Memory as bytes and back, for state that only the very same program reads again: numbers and structs as they lie in
// memory, vectors with their length, and what has a visit(archive, self) by that. One function can serve both ways:
// archive(a, b, c). Plain values; one thread.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "common/bytes.h"

namespace radiosity {

class ArchiveWriter {
 public:
  /// Never takes more than `most` bytes: what would is left out, and fits() is false.
  explicit ArchiveWriter(std::size_t most) : most_(most) {}

  template <typename... T>
  void operator()(const T&... values) {
    (put(values), ...);
  }
  [[nodiscard]] bool fits() const { return fits_; }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }
  [[nodiscard]] Bytes take() { return std::move(bytes_); }

 private:
  template <typename T>
  void put(const T& value) {
    if constexpr (requires { T::visit(*this, value); }) {
      T::visit(*this, value);
    } else {
      static_assert(std::is_trivially_copyable_v<T>);
      append(&value, sizeof(T));
    }
  }
  template <typename T>
  void put(const std::shared_ptr<const std::vector<T>>& values) {
    put(values ? *values : std::vector<T>());
  }
  template <typename T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint64_t>(values.size()));
    if constexpr (std::is_same_v<T, bool>) {
      for (const bool value : values) put(value);
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      append(values.data(), values.size() * sizeof(T));
    } else {
      for (const auto& value : values) put(value);
    }
  }
  template <typename T, std::size_t N>
  void put(const std::array<std::vector<T>, N>& values) {
    for (const auto& value : values) put(value);
  }
  void put(const std::string& text) {
    put(static_cast<std::uint64_t>(text.size()));
    append(text.data(), text.size());
  }
  void append(const void* data, std::size_t size) {
    fits_ = fits_ && size <= most_ - bytes_.size();
    if (!fits_ || size == 0) return;
    const auto* first = static_cast<const std::uint8_t*>(data);
    bytes_.insert(bytes_.end(), first, first + size);
  }

  std::size_t most_;
  Bytes bytes_;
  bool fits_ = true;
};

class ArchiveReader {
 public:
  explicit ArchiveReader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  /// Reads in the order in which it was written. After the first thing that is not there nothing is read any more.
  template <typename... T>
  void operator()(T&... values) {
    (get(values), ...);
  }
  /// All was there so far.
  [[nodiscard]] bool ok() const { return ok_; }
  void fail() { ok_ = false; }

 private:
  template <typename T>
  void get(T& value) {
    if constexpr (requires { T::visit(*this, value); }) {
      T::visit(*this, value);
    } else {
      static_assert(std::is_trivially_copyable_v<T>);
      extract(&value, sizeof(T));
    }
  }
  /// Null where it is empty.
  template <typename T>
  void get(std::shared_ptr<const std::vector<T>>& values) {
    std::vector<T> read;
    get(read);
    values = read.empty() ? nullptr : std::make_shared<const std::vector<T>>(std::move(read));
  }
  template <typename T>
  void get(std::vector<T>& values) {
    std::uint64_t count = 0;
    get(count);
    constexpr std::size_t kLeast = std::is_trivially_copyable_v<T> ? sizeof(T) : 1;
    ok_ = ok_ && count <= rest_.size() / kLeast;
    if (!ok_) return;
    values.resize(static_cast<std::size_t>(count));
    if constexpr (std::is_same_v<T, bool>) {
      for (std::size_t i = 0; i < values.size(); ++i) {
        bool value = false;
        get(value);
        values[i] = value;
      }
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      extract(values.data(), values.size() * sizeof(T));
    } else {
      for (auto& value : values) get(value);
    }
  }
  template <typename T, std::size_t N>
  void get(std::array<std::vector<T>, N>& values) {
    for (auto& value : values) get(value);
  }
  void get(std::string& text) {
    std::uint64_t size = 0;
    get(size);
    ok_ = ok_ && size <= rest_.size();
    if (!ok_) return;
    text.assign(reinterpret_cast<const char*>(rest_.data()), static_cast<std::size_t>(size));
    rest_ = rest_.subspan(static_cast<std::size_t>(size));
  }
  void extract(void* data, std::size_t size) {
    ok_ = ok_ && size <= rest_.size();
    if (!ok_ || size == 0) return;
    std::memcpy(data, rest_.data(), size);
    rest_ = rest_.subspan(size);
  }

  std::span<const std::uint8_t> rest_;
  bool ok_ = true;
};

}  // namespace radiosity
