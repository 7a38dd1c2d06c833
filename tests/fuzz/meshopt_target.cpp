// A view that meshopt compressed, with the members of its extension: as many bytes as it declares, or refused.
#include <algorithm>
#include <array>
#include <span>

#include "server/scene/compression/meshopt_view.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"
#include "tests/unit/scene/compressed_meshes.h"

namespace radiosity::fuzz {
namespace {

constexpr double kMostSeconds = 5.0;
constexpr long kMostKilobytes = 256L << 10U;
constexpr std::array kModes = {"ATTRIBUTES", "TRIANGLES", "INDICES", "POINTS"};
constexpr std::array kFilters = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"};
/// Declared before the stream: mode, filter, stride, and a count of two bytes.
constexpr std::size_t kDeclared = 5;

Seed seedOf(std::uint8_t mode, std::uint8_t filter, std::size_t stride, std::size_t count, const Bytes& stream) {
  Seed seed(kDeclared + stream.size());
  seed[0] = mode;
  seed[1] = filter;
  seed[2] = static_cast<std::uint8_t>(stride);
  seed[3] = static_cast<std::uint8_t>(count % 256);
  seed[4] = static_cast<std::uint8_t>(count / 256);
  std::ranges::copy(stream, seed.begin() + kDeclared);
  return seed;
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  const scene::test::Grid grid(9);
  for (const std::size_t stride : {4U, 8U, 12U}) {
    Bytes elements(40 * stride);
    for (std::size_t i = 0; i < elements.size(); ++i) elements[i] = static_cast<std::uint8_t>(i * i / 7);
    const auto stream = scene::test::meshoptAttributes(elements, 40);
    for (const std::uint8_t filter : {0, 1, 2, 3}) all.push_back(seedOf(0, filter, stride, 40, stream));
  }
  for (const std::uint8_t mode : {1, 2})
    for (const std::size_t width : {2U, 4U})
      all.push_back(seedOf(mode, 0, width, grid.indices.size(),
                           scene::test::meshoptIndices(grid.indices, grid.points(), mode == 1)));
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  if (size < fuzz::kDeclared) return 0;
  const scene::MeshoptView view{fuzz::kModes.at(data[0] % fuzz::kModes.size()),
                                fuzz::kFilters.at(data[1] % fuzz::kFilters.size()),
                                data[3] + 256U * static_cast<std::size_t>(data[4]), data[2]};
  if (const auto sound = scene::checkMeshopt(view, "fuzz"); !sound) {
    fuzz::require(!sound.error().message.empty(), "a refusal says why");
    return 0;
  }
  const fuzz::Cost cost;
  const auto bytes = scene::decodeMeshopt({data + fuzz::kDeclared, size - fuzz::kDeclared}, view, "fuzz");
  cost.requireAtMost(fuzz::kMostSeconds, fuzz::kMostKilobytes);
  fuzz::require(bytes ? bytes->size() == view.bytes() : !bytes.error().message.empty(),
                "there are as many bytes as declared, or a refusal says why");
  return 0;
}
