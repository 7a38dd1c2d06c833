#include "common/printable.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace radiosity {
namespace {

unsigned byteAt(std::string_view text, std::size_t i) { return static_cast<unsigned char>(text[i]); }

/// What stands for a character, empty where it is shown as it is; an empty `character`: for the byte alone.
std::string escapeOf(std::string_view character, unsigned byte) {
  if (character.empty() || (byte < 0x20 && byte != '\t') || byte == 0x7f) return fmt::format("\\x{:02x}", byte);
  const bool is_control = character.size() == 2 && byte == 0xc2 && byteAt(character, 1) < 0xa0;  // U+0080 to U+009F
  if (is_control) return fmt::format("\\u{:04x}", byteAt(character, 1));
  if (character == "\xe2\x80\xa8") return "\\u2028";  // line separator
  if (character == "\xe2\x80\xa9") return "\\u2029";  // paragraph separator
  return {};
}

}  // namespace

std::size_t characterLength(std::string_view text) {
  struct Form {
    unsigned first, last;    ///< of the first byte
    unsigned second, until;  ///< of the second byte; those after it: 0x80..0xbf
    std::size_t length;
  };
  static constexpr std::array kForms = {
      Form{0x00, 0x7f, 0, 0, 1},       Form{0xc2, 0xdf, 0x80, 0xbf, 2}, Form{0xe0, 0xe0, 0xa0, 0xbf, 3},
      Form{0xe1, 0xec, 0x80, 0xbf, 3}, Form{0xed, 0xed, 0x80, 0x9f, 3}, Form{0xee, 0xef, 0x80, 0xbf, 3},
      Form{0xf0, 0xf0, 0x90, 0xbf, 4}, Form{0xf1, 0xf3, 0x80, 0xbf, 4}, Form{0xf4, 0xf4, 0x80, 0x8f, 4}};
  if (text.empty()) return 0;
  for (const auto& form : kForms) {
    if (byteAt(text, 0) < form.first || byteAt(text, 0) > form.last) continue;
    if (text.size() < form.length) return 0;
    for (std::size_t i = 1; i < form.length; ++i) {
      const unsigned low = i == 1 ? form.second : 0x80;
      const unsigned high = i == 1 ? form.until : 0xbf;
      if (byteAt(text, i) < low || byteAt(text, i) > high) return 0;
    }
    return form.length;
  }
  return 0;
}

std::string printable(std::string_view text) {
  std::string out;
  for (std::size_t length = 0; !text.empty(); text.remove_prefix(length)) {
    length = characterLength(text);
    const auto escape = escapeOf(text.substr(0, length), byteAt(text, 0));
    out += escape.empty() ? text.substr(0, length) : std::string_view(escape);
    length = std::max<std::size_t>(length, 1);
  }
  return out;
}

}  // namespace radiosity
