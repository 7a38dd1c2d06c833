// What node runs to turn KTX2 into PNG, as bytes of the program: client/web/build_transcoder.cmake writes them.
#pragma once

#include <string_view>

namespace radiosity::cli {

/// All empty where the npm packages were missing when this was built.
struct TranscoderFiles {
  std::string_view script;  ///< an ES module: node SCRIPT BASIS.js BASIS.wasm IN OUT
  std::string_view basis_script, basis_wasm;
};
[[nodiscard]] TranscoderFiles transcoderFiles();

}  // namespace radiosity::cli
