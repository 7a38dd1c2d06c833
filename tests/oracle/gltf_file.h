// A glTF file as JSON and bytes: chunks of a .glb, files and data: URIs beside a .gltf, numbers of accessors. Of the
// oracle's own, so that a mistake in the server's importer cannot hide in both.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

namespace radiosity::oracle {

class GltfFile {
 public:
  /// Throws std::runtime_error.
  explicit GltfFile(const std::filesystem::path& file);

  [[nodiscard]] const nlohmann::json& json() const { return json_; }
  /// A member of the top level; an empty array where there is none.
  [[nodiscard]] const nlohmann::json& member(const char* name) const;

  /// Calls visit(element, component, value) for every number of an accessor; where it is normalized they are fractions.
  using Visit = std::function<void(std::size_t, std::size_t, double)>;
  void visitAccessor(std::size_t index, std::size_t components, const Visit& visit) const;
  [[nodiscard]] std::size_t count(std::size_t accessor) const;

  [[nodiscard]] std::span<const char> bytesOfView(std::size_t index) const;
  /// What a URI names: a file beside this one, or the URI's own data.
  [[nodiscard]] std::vector<char> bytesOfUri(const std::string& uri) const;

 private:
  void readGlb(const std::vector<char>& bytes);
  void readBuffers(std::vector<char> bin);
  [[nodiscard]] static double number(std::span<const char> view, std::size_t at, int type);

  std::filesystem::path folder_;
  nlohmann::json json_;
  std::vector<std::vector<char>> buffers_;
};

[[nodiscard]] glm::dvec3 vector3(const nlohmann::json& array);

}  // namespace radiosity::oracle
