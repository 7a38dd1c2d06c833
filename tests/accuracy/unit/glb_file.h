// A GLB made by hand, for tests.
#pragma once

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

namespace radiosity::accuracy {

/// Of `gltf`, whose only buffer is `bin`.
inline void writeGlb(const nlohmann::json& gltf, const std::string& bin, const std::filesystem::path& file) {
  std::string text = gltf.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string bytes = "glTF";
  const auto put = [&](std::size_t v) { bytes.append(reinterpret_cast<const char*>(&v), 4); };
  put(2);
  put(28 + text.size() + bin.size());
  put(text.size());
  bytes += "JSON" + text;
  put(bin.size());
  bytes.append("BIN\0", 4);
  std::ofstream(file, std::ios::binary) << bytes << bin;
}

}  // namespace radiosity::accuracy
