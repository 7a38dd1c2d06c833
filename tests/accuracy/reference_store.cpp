#include "tests/accuracy/reference_store.h"

#include <cstdio>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <type_traits>

namespace radiosity::accuracy {
namespace {

constexpr char kMagic[8] = {'R', 'A', 'D', 'R', 'E', 'F', '0', '4'};
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
    hash.add(texture.width), hash.add(texture.height);
    for (const auto byte : texture.rgba) hash.add(byte);
  }
}

void addProbe(const LitScene& lit, Hash& hash) {
  std::vector<oracle::Footprint> probes;
  const auto& triangles = lit.scene.triangles;
  for (std::size_t i = 0; i < kProbes && !triangles.empty(); ++i) {
    const auto& triangle = triangles[i * (triangles.size() - 1) / kProbes];
    probes.push_back({{{triangle.corners, triangle.normal}}});
  }
  for (const auto& answer : oracle::PathTracer(lit.scene).irradiance(probes, {.samples = kProbeSamples})) {
    hash.add(answer.mean_lux);
    hash.add(answer.visible_fraction);
  }
}

/// One way for both directions: `visit` is called for each number of a reference, in the file's order.
template <typename Visit>
void visitTexel(Reference::TexelMean& texel, Visit visit) {
  visit(texel.page), visit(texel.x), visit(texel.y), visit(texel.area), visit(texel.plain);
  visit(texel.irradiance.mean_lux), visit(texel.irradiance.standard_error), visit(texel.irradiance.visible_fraction),
      visit(texel.irradiance.undecided_fraction);
}
template <typename Visit>
void visitPoint(Reference::Point& point, Visit visit) {
  visit(point.page), visit(point.uv);
  visit(point.irradiance.mean_lux), visit(point.irradiance.standard_error), visit(point.irradiance.visible_fraction),
      visit(point.irradiance.undecided_fraction);
}

template <typename Visit>
void visitReference(Reference& reference, Visit visit) {
  visit(reference.seconds), visit(reference.exact);
  for (auto& texel : reference.texels) visitTexel(texel, visit);
  for (auto& point : reference.points) visitPoint(point, visit);
}

}  // namespace

std::string referenceKey(const LitScene& lit, const ReferenceOptions& options) {
  Hash hash;
  for (const auto& triangle : lit.scene.triangles) {
    for (std::size_t k = 0; k < 3; ++k) hash.add(triangle.corners[k]), hash.add(triangle.lightmap_uv[k]);
    hash.add(triangle.reflectance);
    hash.add(triangle.emission_lux);
    hash.add(triangle.double_sided);
    hash.add(triangle.lightmap_page);
    for (const auto& uv : triangle.texture_uv) hash.add(uv);
    hash.add(triangle.texture), hash.add(triangle.see_through), hash.add(triangle.alpha), hash.add(triangle.cutoff);
    hash.add(triangle.transmission);
  }
  addLights(lit.scene, hash);
  for (const auto& page : lit.pages) hash.add(page.width), hash.add(page.height);
  hash.add(options.texel_samples);
  hash.add(options.point_samples);
  hash.add(options.texels);
  hash.add(options.points);
  hash.add(options.seed);
  hash.add(options.closed_form);
  addProbe(lit, hash);
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

StoredReference findReference(const LitScene& lit, const ReferenceOptions& options,
                              const std::filesystem::path& folder) {
  const auto file = folder / (referenceKey(lit, options) + ".reference");
  if (auto found = loadReference(file)) return {std::move(*found), true};
  std::filesystem::create_directories(folder);
  StoredReference made{makeReference(lit, options), false};
  saveReference(made.reference, file);
  return made;
}

}  // namespace radiosity::accuracy
