// Pages and scripts that go beside an exported scene, as bytes of the program: CMakeLists.txt writes them.
#pragma once

#include <string_view>
#include <vector>

namespace radiosity::engines {

struct EngineFile {
  std::string_view name;  ///< below files/: "three/index.html"
  std::string_view bytes;
};
[[nodiscard]] std::vector<EngineFile> allEngineFiles();

}  // namespace radiosity::engines
