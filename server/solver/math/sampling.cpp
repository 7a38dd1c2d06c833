#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t reverseBits(std::uint32_t x) {
  x = ((x >> 1) & 0x55555555U) | ((x & 0x55555555U) << 1);
  x = ((x >> 2) & 0x33333333U) | ((x & 0x33333333U) << 2);
  x = ((x >> 4) & 0x0F0F0F0FU) | ((x & 0x0F0F0F0FU) << 4);
  return __builtin_bswap32(x);
}

/// Laine-Karras style permutation with Vegdahl's constants. It acts on reversed bits, so that it is an Owen scramble;
/// what comes out is not reversed any more.
std::uint32_t owenScrambleReversed(std::uint32_t x, std::uint32_t seed) {
  x ^= x * 0x3d20adeaU;
  x += seed;
  x *= (seed >> 16) | 1U;
  x ^= x * 0x05526c56U;
  x ^= x * 0x53a22864U;
  return reverseBits(x);
}

/// Direction numbers of Sobol dimensions 1..3 (Joe and Kuo); dimension 0 is the radical inverse.
using Directions = std::array<std::uint32_t, 32>;

constexpr Directions makeDirections(std::uint32_t degree, std::uint32_t polynomial,
                                    std::array<std::uint32_t, 3> first) {
  Directions v{};
  for (std::uint32_t i = 0; i < 32; ++i) {
    if (i < degree) {
      v[i] = first[i] << (31U - i);
      continue;
    }
    v[i] = v[i - degree] ^ (v[i - degree] >> degree);
    for (std::uint32_t k = 1; k < degree; ++k) {
      if ((polynomial >> (degree - 1 - k)) & 1U) v[i] ^= v[i - k];
    }
  }
  return v;
}

constexpr std::array<Directions, 3> kDirections = {makeDirections(1, 0, {1, 0, 0}), makeDirections(2, 1, {1, 3, 0}),
                                                   makeDirections(3, 1, {1, 3, 1})};

/// By byte of the index, and its value: what its bits contribute, reversed. A shuffled index has 32 bits, of which any
/// may be set.
using ByteTables = std::array<std::array<std::uint32_t, 256>, 4>;

constexpr ByteTables makeTables(const Directions& directions) {
  ByteTables tables{};
  for (std::uint32_t byte = 0; byte < 4; ++byte) {
    for (std::uint32_t value = 0; value < 256; ++value) {
      for (std::uint32_t bit = 0; bit < 8; ++bit) {
        if ((value >> bit) & 1U) tables[byte][value] ^= reverseBits(directions[8 * byte + bit]);
      }
    }
  }
  return tables;
}

constexpr std::array<ByteTables, 3> kTables = {makeTables(kDirections[0]), makeTables(kDirections[1]),
                                               makeTables(kDirections[2])};

/// Dimension 0 is the index itself, reversed.
std::uint32_t reversedSobolBits(std::uint32_t index, std::uint32_t dimension) {
  if (dimension == 0) return index;
  const auto& table = kTables[dimension - 1];
  return table[0][index & 255U] ^ table[1][(index >> 8U) & 255U] ^ table[2][(index >> 16U) & 255U] ^
         table[3][index >> 24U];
}

}  // namespace

std::uint64_t mixKeys(std::uint64_t a, std::uint64_t b) {
  std::uint64_t z = a + 0x9e3779b97f4a7c15ULL * (b + 1);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

Sobol4::Sobol4(std::uint64_t key) : shuffle_(static_cast<std::uint32_t>(mixKeys(key, 0))) {
  for (std::uint32_t d = 0; d < 4; ++d) scramble_[d] = static_cast<std::uint32_t>(mixKeys(key, d + 1));
}

glm::dvec4 Sobol4::operator()(std::uint32_t index) const {
  const std::uint32_t shuffled = owenScrambleReversed(reverseBits(index), shuffle_);
  glm::dvec4 point;
  for (std::uint32_t d = 0; d < 4; ++d)
    point[static_cast<int>(d)] = owenScrambleReversed(reversedSobolBits(shuffled, d), scramble_[d]) * 0x1p-32;
  return point;
}

glm::dvec4 sobol4(std::uint32_t index, std::uint64_t key) { return Sobol4(key)(index); }

double uniformFromKey(std::uint64_t key) { return static_cast<double>(mixKeys(key, 77) >> 11) * 0x1p-53; }

}  // namespace radiosity::solver
