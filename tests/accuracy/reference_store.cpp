#include "tests/accuracy/reference_store.h"

#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace radiosity::accuracy {
namespace {

constexpr char kMagic[8] = {'R', 'A', 'D', 'R', 'E', 'F', '0', '6'};
constexpr std::size_t kMaxRecords = 1 << 26;
constexpr std::size_t kProbes = 16;
constexpr std::uint32_t kProbeSamples = 64;

/// FNV-1a (Fowler, Noll, Vo), 64 bits.
class Hash {
 public:
  template <typename T>
  void add(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_same_v<T, glm::dvec3> || std::is_same_v<T, glm::dvec2>);
    unsigned char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    for (const auto byte : bytes) state_ = (state_ ^ byte) * 0x100000001B3ULL;
  }
  [[nodiscard]] std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xCBF29CE484222325ULL;
};

/// What else gives or takes light: lamps, the sky, textures.
void addLights(const oracle::TriangleScene& scene, Hash& hash) {
  for (const auto& lamp : scene.lamps) {
    hash.add(static_cast<int>(lamp.kind));
    hash.add(lamp.position), hash.add(lamp.direction), hash.add(lamp.intensity);
    hash.add(lamp.range), hash.add(lamp.inner_rad), hash.add(lamp.outer_rad);
  }
  hash.add(scene.sky_upper), hash.add(scene.sky_lower);
  for (const auto& texture : scene.textures) {
    hash.add(static_cast<int>(texture.wrap_u)), hash.add(static_cast<int>(texture.wrap_v)), hash.add(texture.nearest);
    hash.add(texture.image->width), hash.add(texture.image->height);
    for (const auto byte : texture.image->rgba) hash.add(byte);
  }
}

void addUse(const oracle::TextureUse& use, Hash& hash) {
  hash.add(use.texture);
  for (const auto& uv : use.uv) hash.add(uv);
}

/// Whether all light that enters goes on. References of other glass, which were kept before its texture was known and
/// before its interface took from what it scatters, are of no use; those of this kind still hold.
bool onlyPasses(const oracle::Triangle& triangle) {
  return triangle.transmission >= 1.0 && triangle.passing.texture < 0 && triangle.mirror.metallic <= 0.0;
}

/// What light is traced in.
void addTriangles(const oracle::TriangleScene& scene, Hash& hash) {
  for (const auto& triangle : scene.triangles) {
    for (std::size_t k = 0; k < 3; ++k) hash.add(triangle.corners[k]), hash.add(triangle.shading[k]);
    hash.add(triangle.reflectance), hash.add(triangle.emission_lux), hash.add(triangle.double_sided);
    for (const auto* use : {&triangle.base_colour, &triangle.emissive, &triangle.metal, &triangle.specular_texture,
                            &triangle.transmission_part, &triangle.transmission_colour}) {
      addUse(*use, hash);
    }
    hash.add(triangle.metallic), hash.add(triangle.specular);
    for (const auto& colour : triangle.colours) hash.add(glm::dvec3(colour)), hash.add(colour.w);
    hash.add(triangle.see_through), hash.add(triangle.alpha), hash.add(triangle.cutoff),
        hash.add(triangle.transmission), hash.add(triangle.diffuse_transmission), hash.add(triangle.transmitted);
    const auto& mirror = triangle.mirror;
    hash.add(mirror.metallic), hash.add(mirror.colour), hash.add(mirror.interface), hash.add(mirror.roughness);
    hash.add(mirror.attenuation);
    if (triangle.transmission > 0.0 && !onlyPasses(triangle)) addUse(triangle.passing, hash);
  }
}

/// Where texels lie.
void addLayout(const LitScene& lit, Hash& hash) {
  for (const auto& triangle : lit.scene.triangles) {
    for (std::size_t k = 0; k < 3; ++k) hash.add(triangle.corners[k]), hash.add(triangle.lightmap_uv[k]);
    hash.add(triangle.lightmap_page), hash.add(triangle.double_sided);
  }
  for (const auto& page : lit.pages) hash.add(page.width), hash.add(page.height);
}

void addProbe(const oracle::TriangleScene& scene, Hash& hash) {
  std::vector<oracle::Footprint> probes;
  const auto& triangles = scene.triangles;
  for (std::size_t i = 0; i < kProbes && !triangles.empty(); ++i) {
    const auto& triangle = triangles[i * (triangles.size() - 1) / kProbes];
    probes.push_back({{{triangle.corners, triangle.normal, oracle::kNoTriangle, triangle.shading}}});
  }
  for (const auto& answer : oracle::PathTracer(scene).irradiance(probes, {.samples = kProbeSamples})) {
    hash.add(answer.mean_lux);
    hash.add(answer.visible_fraction);
  }
}

/// One way for both directions: `visit` is called for each number of a reference, in the file's order.
template <typename Visit>
void visitIrradiance(oracle::Irradiance& irradiance, Visit visit) {
  visit(irradiance.mean_lux), visit(irradiance.standard_error), visit(irradiance.visible_fraction);
  visit(irradiance.undecided_fraction), visit(irradiance.back_fraction), visit(irradiance.open_fraction);
}

template <typename Visit>
void visitReference(Reference& reference, Visit visit) {
  visit(reference.seconds), visit(reference.exact), visit(reference.cut_area), visit(reference.hidden_area);
  for (auto& texel : reference.texels) {
    visit(texel.page), visit(texel.x), visit(texel.y), visit(texel.back), visit(texel.area), visit(texel.plain);
    visitIrradiance(texel.irradiance, visit);
  }
  for (auto& point : reference.points) {
    visit(point.position), visit(point.normal);
    visitIrradiance(point.irradiance, visit);
  }
}

}  // namespace

std::string referenceKey(const LitScene& lit, const ReferenceOptions& options, ReferencePart part) {
  Hash hash;
  addTriangles(lit.traced(), hash);
  addLights(lit.traced(), hash);
  if (part == ReferencePart::kTexels) {
    addLayout(lit, hash);
    hash.add(options.texel_samples), hash.add(options.texels);
  } else {
    hash.add(options.point_samples), hash.add(options.points);
  }
  hash.add(static_cast<int>(part));
  hash.add(options.seed);
  hash.add(options.closed_form);
  addProbe(lit.traced(), hash);
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(hash.value()));
  return text;
}

void saveReference(const Reference& reference, const std::filesystem::path& file) {
  const auto beside = file.string() + ".part";
  std::ofstream out(beside, std::ios::binary);
  const auto put = [&out](const auto& value) { out.write(reinterpret_cast<const char*>(&value), sizeof value); };
  put(kMagic);
  put(static_cast<std::uint64_t>(reference.texels.size()));
  put(static_cast<std::uint64_t>(reference.points.size()));
  auto copy = reference;
  visitReference(copy, put);
  put(kMagic);
  out.close();
  if (!out) throw std::runtime_error("cannot write " + beside);
  std::filesystem::rename(beside, file);
}

std::optional<Reference> loadReference(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const auto get = [&in](auto& value) { in.read(reinterpret_cast<char*>(&value), sizeof value); };
  char magic[sizeof kMagic] = {};
  std::uint64_t texels = 0, points = 0;
  get(magic), get(texels), get(points);
  if (!in || std::memcmp(magic, kMagic, sizeof kMagic) != 0 || texels > kMaxRecords || points > kMaxRecords) return {};
  // a count that lies must not make us reserve memory for it
  if (std::error_code error; (texels + points) * sizeof(double) > std::filesystem::file_size(file, error)) return {};
  Reference reference;
  reference.texels.resize(texels);
  reference.points.resize(points);
  visitReference(reference, get);
  get(magic);
  if (!in || std::memcmp(magic, kMagic, sizeof kMagic) != 0 || in.peek() != std::ifstream::traits_type::eof())
    return {};
  return reference;
}

StoredReference findPart(const LitScene& lit, const ReferenceOptions& options, ReferencePart part,
                         const std::filesystem::path& folder) {
  const auto file = folder / (referenceKey(lit, options, part) + ".reference");
  if (auto found = loadReference(file)) return {std::move(*found), true};
  std::filesystem::create_directories(folder);
  StoredReference made{makePart(lit, options, part), false};
  saveReference(made.reference, file);
  return made;
}

StoredReference findReference(const LitScene& lit, const ReferenceOptions& options,
                              const std::filesystem::path& folder) {
  auto texels = findPart(lit, options, ReferencePart::kTexels, folder);
  auto points = findPart(lit, options, ReferencePart::kPoints, folder);
  return {join(std::move(texels.reference), std::move(points.reference)), texels.from_disk && points.from_disk};
}

}  // namespace radiosity::accuracy
