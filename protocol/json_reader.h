// Reads members of a JSON object into plain values, checking kind, range and length. The first thing that is wrong is
// kept with its JSON pointer; later reads do nothing, so a decoder reads all members and asks once at the end. For this
// folder's .cpp files only.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace radiosity::protocol {

enum class Need { kRequired, kOptional };

/// Bounds of a number, as they are said in the error message.
struct Range {
  double low = 0.0, high = std::numeric_limits<double>::max();
  bool open_low = false;  ///< (low, high]
};

class Reader {
 public:
  /// `object` may be null (parameters left out); it must outlive the reader.
  Reader(const nlohmann::json* object, std::string pointer);

  void number(const char* key, double& out, Need need, Range range);
  void integer(const char* key, std::uint64_t& out, Need need, std::uint64_t low, std::uint64_t high);
  void text(const char* key, std::string& out, Need need, std::size_t max_bytes);
  void boolean(const char* key, bool& out, Need need);
  /// One of the names that `from` knows; `names` is for the message.
  template <typename T>
  void choice(const char* key, T& out, Need need, std::optional<T> (*from)(std::string_view), const char* names);
  /// Calls `read` with a reader of the member object.
  void object(const char* key, Need need, const std::function<void(Reader&)>& read);
  /// Calls `read` with each element and its pointer; at most `max` of them.
  void array(const char* key, Need need, std::size_t max,
             const std::function<void(const nlohmann::json&, const std::string&)>& read);

  template <typename T>
  void optionalInteger(const char* key, std::optional<T>& out, std::uint64_t low, std::uint64_t high);
  void optionalNumber(const char* key, std::optional<double>& out, Range range);
  /// An integer that fits the narrower type; `high` must.
  template <typename T>
  void narrow(const char* key, T& out, Need need, std::uint64_t low, std::uint64_t high);

  [[nodiscard]] const nlohmann::json* find(const char* key) const;
  [[nodiscard]] std::string pointerOf(const char* key) const;
  void refuse(std::string pointer, const std::string& what);

  [[nodiscard]] bool failed() const { return !message_.empty(); }
  [[nodiscard]] const std::string& message() const { return message_; }
  [[nodiscard]] const std::string& pointer() const { return bad_pointer_; }

 private:
  /// The member, or null; refuses when it is required and missing.
  const nlohmann::json* member(const char* key, Need need);

  const nlohmann::json* object_;
  std::string base_, bad_pointer_, message_;
};

template <typename T>
void Reader::optionalInteger(const char* key, std::optional<T>& out, std::uint64_t low, std::uint64_t high) {
  if (find(key) == nullptr) return;
  T value{};
  narrow(key, value, Need::kOptional, low, high);
  out = value;
}

template <typename T>
void Reader::narrow(const char* key, T& out, Need need, std::uint64_t low, std::uint64_t high) {
  auto value = static_cast<std::uint64_t>(out);
  integer(key, value, need, low, high);
  out = static_cast<T>(value);
}

template <typename T>
void Reader::choice(const char* key, T& out, Need need, std::optional<T> (*from)(std::string_view), const char* names) {
  std::string text_value;
  if (member(key, need) == nullptr) return;
  text(key, text_value, need, 64);
  if (failed()) return;
  if (const auto value = from(text_value))
    out = *value;
  else
    refuse(pointerOf(key), std::string("must be one of ") + names);
}

}  // namespace radiosity::protocol
