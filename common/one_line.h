// Text of files and peers for a terminal.
#pragma once

#include <string>
#include <string_view>

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

/// Bytes of the character that it begins with; 0: none of UTF-8 (RFC 3629, without what it forbids among three and four
/// bytes but for the first).
[[nodiscard]] inline std::size_t characterLength(std::string_view text) {
  const auto lead = text.empty() ? 0xff : static_cast<unsigned char>(text[0]);
  const std::size_t length = lead < 0x80                   ? 1
                             : lead >= 0xc2 && lead < 0xe0 ? 2
                             : lead >= 0xe0 && lead < 0xf0 ? 3
                             : lead >= 0xf0 && lead < 0xf5 ? 4
                                                           : 0;
  if (length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xc0U) != 0x80) return 0;
  }
  return length;
}

/// The same of at most so many bytes, which end with a character; a byte that is no part of one becomes '?'.
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
