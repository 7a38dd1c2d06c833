// Text of files and peers, for logs and terminals: valid UTF-8 on one line, whatever it was. Pure; any thread.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace radiosity {

/// Bytes of the character of UTF-8 (RFC 3629) at the front of `text`, 1 to 4; 0: there is none.
[[nodiscard]] std::size_t characterLength(std::string_view text);

/// Control characters but tabs, line separators and bytes that are not UTF-8 are written as \x0a, \u009b, \u2028
/// and \xff, so that nothing begins a line of its own or moves a cursor.
[[nodiscard]] std::string printable(std::string_view text);

}  // namespace radiosity
