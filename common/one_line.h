// Text of files and peers for a terminal.
#pragma once

#include <string>
#include <string_view>

#include "common/printable.h"

namespace radiosity {

/// Control characters would move the cursor, or worse: each becomes a space, those of UTF-8 (U+0080 to U+009F) two. A
/// byte that is no part of a character of UTF-8 becomes '?'.
[[nodiscard]] inline std::string oneLine(std::string text) {
  for (std::size_t i = 0, length = 0; i < text.size(); i += length) {
    length = characterLength(std::string_view(text).substr(i));
    const auto c = static_cast<unsigned char>(text[i]);
    if (length == 0) {
      text[i] = '?';
      length = 1;
    } else if (c < ' ' || c == 0x7f) {
      text[i] = ' ';
    } else if (c == 0xc2 && static_cast<unsigned char>(text[i + 1]) <= 0x9f) {
      text[i] = text[i + 1] = ' ';
    }
  }
  return text;
}

/// The same of at most so many bytes, which end with a character.
[[nodiscard]] inline std::string shortLine(std::string_view text, std::size_t most) {
  std::string line;
  while (!text.empty()) {
    const auto length = characterLength(text);
    const auto taken = length > 0 ? length : 1;
    if (line.size() + taken > most) break;
    line += length > 0 ? text.substr(0, length) : "?";
    text.remove_prefix(taken);
  }
  return oneLine(std::move(line));
}

}  // namespace radiosity
