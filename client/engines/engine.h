// The engines that scenes are written for. Plain values; any thread.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace radiosity::engines {

/// How lightmap pages are stored.
enum class Encoding {
  kHalfExr,       ///< OpenEXR, half floats, zip
  kPlainHalfExr,  ///< OpenEXR, half floats, not compressed
  kHalfDds,       ///< DirectDraw Surface, RGBA half floats
};

struct Engine {
  std::string_view name;   ///< as options have it
  std::string_view title;  ///< as its makers write it
  Encoding encoding = Encoding::kHalfExr;
  std::string_view next;  ///< what to do with the folder, for the user
};

[[nodiscard]] const std::vector<Engine>& allEngines();
/// Null: there is none of that name.
[[nodiscard]] const Engine* findEngine(std::string_view name);
/// In the order of allEngines().
[[nodiscard]] std::vector<std::string> engineNames();
/// "half-float EXR"
[[nodiscard]] std::string_view encodingText(Encoding encoding);

}  // namespace radiosity::engines
