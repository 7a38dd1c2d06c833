// The product of a solve as a stranger reads it: the lit GLB (TEXCOORD_1 and extras.lightmap) and its EXR pages; and
// what light is traced in, the scene before it was lit. Nothing of the server's code. A value; any thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "tests/oracle/path_tracer.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity::accuracy {

/// Irradiance in lux, row 0 = v 0.
struct Page {
  int width = 0, height = 0;
  std::vector<glm::vec3> pixels;

  [[nodiscard]] glm::dvec3 at(int x, int y) const;  ///< clamped to the edge
  /// As a shader looks it up: texel centres at half integers, linear between them.
  [[nodiscard]] glm::dvec3 bilinear(const glm::dvec2& uv) const;
};

struct LitScene {
  oracle::TriangleScene scene;  ///< as the lit file has it
  std::vector<Page> pages;
  std::optional<oracle::TriangleScene> unlit = {};  ///< where it differs: sides apart in one are together in the other

  /// What light is traced in.
  [[nodiscard]] const oracle::TriangleScene& traced() const { return unlit ? *unlit : scene; }
};

/// NAME.glb with NAME.lightmap.<page>.exr beside it, for as many pages as the GLB names. Light is traced in it, fronts
/// and their flipped copies joined. Throws std::runtime_error.
[[nodiscard]] LitScene readLitScene(const std::filesystem::path& glb);
/// Light is traced in `unlit`, the file that was lit.
[[nodiscard]] LitScene readLitScene(const std::filesystem::path& glb, const std::filesystem::path& unlit);

[[nodiscard]] Page readExr(const std::filesystem::path& file);
void writeExr(const Page& page, const std::filesystem::path& file);
/// A Portable FloatMap of three channels, little-endian, bottom row first. Throws std::runtime_error.
[[nodiscard]] Page readPfm(const std::filesystem::path& file);

/// A lightmap texel: which part of the scene lies under it.
struct Texel {
  int page = 0, x = 0, y = 0;
  bool back = false;               ///< seen from the backs of double-sided triangles
  double coverage = 0.0;           ///< share of the texel that triangles cover
  double least_reflectance = 1.0;  ///< of any triangle and channel in it
  bool two_sided = false;          ///< some of it is a double-sided triangle
  std::uint32_t node = 0;          ///< of the last of its triangles
  oracle::Footprint footprint;
};

/// All texels that any triangle touches, in a fixed order; where triangles are double-sided a second time, for what is
/// seen from their backs. Each stands for one side. Pieces name triangles of traced().
[[nodiscard]] std::vector<Texel> findTexels(const LitScene& lit);

/// Whether texels of one lie where those of the other do, so that references can be shared.
[[nodiscard]] bool sameLayout(const LitScene& a, const LitScene& b);

}  // namespace radiosity::accuracy
