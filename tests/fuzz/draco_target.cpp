// A Draco stream, with what a file declares of it: read as declared, or refused, within seconds and few megabytes.
#include <algorithm>
#include <array>
#include <span>

#include "server/scene/compression/draco_mesh.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"
#include "tests/unit/scene/compressed_meshes.h"

namespace radiosity::fuzz {
namespace {

// Sanitizers make it ten times as slow, and several times as large.
constexpr double kMostSeconds = 10.0;
constexpr long kMostKilobytes = 512L << 10U;
constexpr std::uint64_t kRoom = std::uint64_t{32} << 20U;
/// Declared before the stream: vertices, triangles (0: not declared), two bytes each.
constexpr std::size_t kDeclared = 4;

std::size_t wordAt(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] + 256U * static_cast<std::size_t>(bytes[at + 1]);
}

Seed seedOf(std::uint32_t side, const scene::test::DracoOptions& options, bool with_triangles) {
  const scene::test::Grid grid(side);
  const auto triangles = with_triangles ? grid.indices.size() / 3 : 0;
  Seed seed;
  for (const auto count : {grid.points(), triangles})
    seed.insert(seed.end(), {static_cast<std::uint8_t>(count % 256), static_cast<std::uint8_t>(count / 256)});
  const auto stream = dracoStream(grid, options);
  seed.insert(seed.end(), stream.begin(), stream.end());
  return seed;
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING})
    for (const int speed : {0, 3, 5, 7, 10})
      for (const std::uint32_t side : {1, 6, 11}) all.push_back(seedOf(side, {method, speed}, side != 6));
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  if (size < fuzz::kDeclared) return 0;
  const std::span<const std::uint8_t> bytes(data, size);
  scene::DracoRequest request;
  request.attributes = {{0, 5126, 3, "position"}, {1, 5126, 2, "uv"}, {2, 5121, 1, "id"}};
  request.points = fuzz::wordAt(bytes, 0);
  if (const auto faces = fuzz::wordAt(bytes, 2); faces != 0) request.faces = faces;
  request.room = request.attribute_room = fuzz::kRoom;
  request.where = "fuzz";
  const fuzz::Cost cost;
  const auto mesh = scene::decodeDraco(bytes.subspan(fuzz::kDeclared), request);
  cost.requireAtMost(fuzz::kMostSeconds, fuzz::kMostKilobytes);
  if (!mesh) {
    fuzz::require(!mesh.error().message.empty(), "a refusal says why");
    return 0;
  }
  fuzz::require(!request.faces || mesh->corners.size() == 3 * *request.faces,
                "there are as many triangles as declared");
  fuzz::require(std::ranges::all_of(mesh->corners, [&](auto corner) { return corner < request.points; }),
                "each corner is a vertex that is there");
  constexpr std::array<std::size_t, 3> kBytes = {12, 8, 1};
  for (std::size_t a = 0; a < kBytes.size(); ++a)
    fuzz::require(mesh->attributes.at(a).size() == kBytes[a] * request.points, "each vertex has each attribute");
  return 0;
}
