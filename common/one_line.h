// Text of files and peers for a terminal.
#pragma once

#include <string>

namespace radiosity {

/// Control characters would move the cursor, or worse: each becomes a space, those of UTF-8 (U+0080 to U+009F) two.
[[nodiscard]] inline std::string oneLine(std::string text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c < ' ' || c == 0x7f) text[i] = ' ';
    if (c != 0xc2 || i + 1 == text.size()) continue;
    if (const auto next = static_cast<unsigned char>(text[i + 1]); next >= 0x80 && next <= 0x9f)
      text[i] = text[i + 1] = ' ';
  }
  return text;
}

}  // namespace radiosity
