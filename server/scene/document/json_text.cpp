#include "server/scene/document/json_text.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "common/task.h"

namespace radiosity::scene {
namespace {

// A value costs the parser some 16 to 100 bytes, however short its text: without this bound 1 GiB of "[],[],..." would
// need a hundred times that.
constexpr std::size_t kMaxJsonValues = std::size_t{1} << 24;

std::string linePlace(const std::string& name, std::string_view text, std::size_t offset) {
  const auto before = text.substr(0, std::min(offset, text.size()));
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const auto newline = before.rfind('\n');
  const auto column = newline == std::string_view::npos ? before.size() : before.size() - newline - 1;
  return name + ": line " + std::to_string(line) + ", column " + std::to_string(column);
}

/// The characters of a text, with an interruption point each 64 KiB: the library takes seconds for the largest texts.
class InterruptibleText {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  explicit InterruptibleText(const char* at) : at_(at) {}
  const char& operator*() const { return *at_; }
  InterruptibleText& operator++() {
    constexpr std::uintptr_t kBetween = 0xFFFF;
    if ((reinterpret_cast<std::uintptr_t>(++at_) & kBetween) == 0) interruptionPoint();
    return *this;
  }
  InterruptibleText operator++(int) {
    auto before = *this;
    ++*this;
    return before;
  }
  bool operator==(const InterruptibleText&) const = default;

 private:
  const char* at_;
};

/// Checks depth and count without recursion. Strings are skipped; anything malformed is left to the parser.
Result<void> scan(std::string_view text, const std::string& name, std::size_t max_depth) {
  std::size_t depth = 0;
  std::size_t values = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\0') {  // the parser takes it for the end and would not look at what follows
      return fail(ErrorCode::kBadInput, "not JSON: zero byte", linePlace(name, text, i));
    }
    if (in_string) {
      if (c == '\\') ++i;
      in_string = c != '"';
      continue;
    }
    if (c == '"') in_string = true;
    if (c == '[' || c == '{' || c == ',') ++values;
    if (c == '[' || c == '{') ++depth;
    if ((c == ']' || c == '}') && depth > 0) --depth;
    if (depth > max_depth) {
      return fail(ErrorCode::kTooLarge, "JSON is nested deeper than " + std::to_string(max_depth) + " levels",
                  linePlace(name, text, i));
    }
    if (values > kMaxJsonValues) {
      return fail(ErrorCode::kTooLarge, "JSON has more than " + std::to_string(kMaxJsonValues) + " values",
                  linePlace(name, text, i));
    }
  }
  return {};
}

}  // namespace

Result<Json> parseJson(std::string_view text, const std::string& name, std::size_t max_depth) {
  if (auto scanned = scan(text, name, max_depth); !scanned) return tl::unexpected(scanned.error());
  // The library reports errors by exception; it goes no further than here.
  try {
    return Json::parse(InterruptibleText(text.data()), InterruptibleText(text.data() + text.size()));
  } catch (const Json::parse_error& e) {
    return fail(ErrorCode::kBadInput, std::string("not JSON: ") + e.what(), linePlace(name, text, e.byte));
  } catch (const Json::exception& e) {  // a number too big for a double
    return fail(ErrorCode::kBadInput, std::string("not JSON that we can hold: ") + e.what(), name + ": JSON");
  }
}

std::size_t jsonDepth(const Json& value) {
  std::size_t deepest = 0;
  std::vector<std::pair<const Json*, std::size_t>> stack{{&value, 1}};
  while (!stack.empty()) {
    const auto [at, depth] = stack.back();
    stack.pop_back();
    if (!at->is_structured()) continue;
    deepest = std::max(deepest, depth);
    for (const auto& child : *at) stack.emplace_back(&child, depth + 1);
  }
  return deepest;
}

bool isIdentical(const Json& a, const Json& b) {
  if (a.type() != b.type()) return false;
  if (a.is_array()) return std::equal(a.begin(), a.end(), b.begin(), b.end(), isIdentical);
  if (!a.is_object()) return a == b;
  const auto& of_b = b.get_ref<const Json::object_t&>();
  return std::ranges::equal(a.get_ref<const Json::object_t&>(), of_b, [](const auto& one, const auto& other) {
    return one.first == other.first && isIdentical(one.second, other.second);
  });
}

std::string escapeToken(std::string_view token) {
  std::string out;
  for (const char c : token) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += c;
    }
  }
  return out;
}

std::string place(const std::string& name, std::string_view pointer) { return name + ": " + std::string(pointer); }

}  // namespace radiosity::scene
