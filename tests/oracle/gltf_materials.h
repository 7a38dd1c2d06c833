// Materials of a glTF file for the oracle, in the terms of a diffuse world: how much is reflected, emitted, let
// through.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "tests/oracle/gltf_file.h"
#include "tests/oracle/texture.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

/// A material's texture before it is known on which triangle: texture_uv = transform x TEXCOORD_<texcoord>.
struct MaterialTexture {
  int texture = -1;
  int texcoord = 0;
  glm::dmat3 transform{1.0};
};

/// As Triangle has them.
struct MaterialValues {
  glm::dvec3 reflectance{0.0}, emission_lux{0.0};
  bool double_sided = false;
  bool see_through = false;
  double alpha = 1.0, cutoff = -1.0, transmission = 0.0;
  Mirror mirror;
  double metallic = 0.0;
  glm::dvec3 specular{0.0};
  double diffuse_transmission = 0.0;
  glm::dvec3 transmitted{0.0};
  MaterialTexture base_colour, emissive, metal, specular_texture, passing, transmission_part, transmission_colour;
};

/// Of the materials that a file names, in its order; what cannot be modelled is named in `warnings`.
[[nodiscard]] std::vector<MaterialValues> readMaterials(const GltfFile& file, std::vector<std::string>& warnings);

/// Of primitives that name no material: white (glTF's default is a perfect metal; ours is said in README.md).
[[nodiscard]] MaterialValues defaultMaterial();

/// All of the file, in its order, each with its image and sampler.
[[nodiscard]] std::vector<Texture> readTextures(const GltfFile& file, std::vector<std::string>& warnings);

}  // namespace radiosity::oracle
