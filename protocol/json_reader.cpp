#include "protocol/json_reader.h"

#include <fmt/format.h>
#include <cmath>
#include <utility>

namespace radiosity::protocol {

using nlohmann::json;

Reader::Reader(const json* object, std::string pointer) : object_(object), base_(std::move(pointer)) {
  if (object_ != nullptr && !object_->is_object()) {
    refuse(base_, "must be an object with named members");
    object_ = nullptr;
  }
}

const json* Reader::find(const char* key) const {
  if (object_ == nullptr) return nullptr;
  const auto found = object_->find(key);
  return found == object_->end() ? nullptr : &*found;
}

std::string Reader::pointerOf(const char* key) const { return base_ + "/" + key; }

void Reader::refuse(std::string pointer, const std::string& what) {
  if (failed()) return;
  message_ = (pointer.empty() ? "result" : pointer) + " " + what;
  bad_pointer_ = std::move(pointer);
}

const json* Reader::member(const char* key, Need need) {
  if (failed()) return nullptr;
  const auto* value = find(key);
  if (value == nullptr && need == Need::kRequired) refuse(pointerOf(key), "is missing");
  return value;
}

void Reader::number(const char* key, double& out, Need need, Range range) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  const double number = value->is_number() ? value->get<double>() : std::nan("");
  const bool high_enough = range.open_low ? number > range.low : number >= range.low;
  if (high_enough && number <= range.high) {
    out = number;
  } else if (range.high >= std::numeric_limits<double>::max()) {
    refuse(pointerOf(key), fmt::format("must be a number {} {}", range.open_low ? "above" : "of at least", range.low));
  } else {
    refuse(pointerOf(key),
           fmt::format("must be a number in {}{}, {}]", range.open_low ? '(' : '[', range.low, range.high));
  }
}

void Reader::integer(const char* key, std::uint64_t& out, Need need, std::uint64_t low, std::uint64_t high) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  // Scripts that compute in floating point send 5.0 for 5.
  std::optional<std::uint64_t> number;
  if (value->is_number_unsigned()) number = value->get<std::uint64_t>();
  if (value->is_number_float()) {
    const auto real = value->get<double>();
    if (real >= 0.0 && real < 9.0e15 && real == std::floor(real)) number = static_cast<std::uint64_t>(real);
  }
  if (number && *number >= low && *number <= high)
    out = *number;
  else
    refuse(pointerOf(key), fmt::format("must be an integer in [{}, {}]", low, high));
}

void Reader::text(const char* key, std::string& out, Need need, std::size_t max_bytes) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  if (!value->is_string())
    refuse(pointerOf(key), "must be a string");
  else if (value->get_ref<const std::string&>().size() > max_bytes)
    refuse(pointerOf(key), fmt::format("must be at most {} bytes long", max_bytes));
  else
    out = value->get<std::string>();
}

void Reader::boolean(const char* key, bool& out, Need need) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  if (value->is_boolean())
    out = value->get<bool>();
  else
    refuse(pointerOf(key), "must be true or false");
}

void Reader::object(const char* key, Need need, const std::function<void(Reader&)>& read) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  Reader inner(value, pointerOf(key));
  if (!inner.failed()) read(inner);
  if (inner.failed()) {
    message_ = inner.message_;
    bad_pointer_ = inner.bad_pointer_;
  }
}

void Reader::array(const char* key, Need need, std::size_t max,
                   const std::function<void(const json&, const std::string&)>& read) {
  const auto* value = member(key, need);
  if (value == nullptr) return;
  if (!value->is_array()) return refuse(pointerOf(key), "must be an array");
  if (value->size() > max) return refuse(pointerOf(key), fmt::format("must have at most {} elements", max));
  for (std::size_t i = 0; i < value->size() && !failed(); ++i)
    read((*value)[i], fmt::format("{}/{}", pointerOf(key), i));
}

void Reader::optionalNumber(const char* key, std::optional<double>& out, Range range) {
  if (find(key) == nullptr) return;
  double value = 0.0;
  number(key, value, Need::kOptional, range);
  out = value;
}

}  // namespace radiosity::protocol
