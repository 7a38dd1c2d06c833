#include "protocol/sky.h"

#include <charconv>
#include <string_view>

namespace radiosity::protocol {
namespace {

/// One number for all channels, or three with commas.
bool parseColor(std::string_view text, std::array<double, 3>& color) {
  std::size_t count = 0;
  const char* at = text.data();
  const char* const end = at + text.size();
  for (;;) {
    if (count == 3) return false;
    double& value = color[count++];
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !(value >= 0.0 && value <= kMaxSkyNits)) return false;
    if (next == end) break;
    if (*next != ',') return false;
    at = next + 1;
  }
  if (count == 1) color[1] = color[2] = color[0];
  return count != 2;
}

}  // namespace

Result<Sky> parseSky(const std::string& text) {
  const std::string_view view(text);
  const auto slash = view.find('/');
  Sky sky;
  const bool good = parseColor(view.substr(0, slash), sky.upper) &&
                    (slash == std::string_view::npos || parseColor(view.substr(slash + 1), sky.lower));
  if (slash == std::string_view::npos) sky.lower = sky.upper;
  if (good) return sky;
  return fail(ErrorCode::kBadUsage,
              "must be nits as 1000, as R,G,B, or as R,G,B/R,G,B (above / below the horizon), each 0 to 1e12",
              "--sky " + text);
}

}  // namespace radiosity::protocol
