// CRC-32C. Reflected polynomial 0x82f63b78, start and end value inverted. Eight table look-ups for eight bytes
// ("slicing by 8": Kounavis and Berry, "Novel Table Lookup-Based Algorithms for High-Performance CRC Generation", IEEE
// Transactions on Computers 57(11), 2008), about a byte a cycle on any machine; a tile costs some ten microseconds, so
// the processor's own instruction is not worth a second code path.
#include <array>

#include "protocol/tile_frame.h"

namespace radiosity::protocol {
namespace {

using Tables = std::array<std::array<std::uint32_t, 256>, 8>;

constexpr Tables makeTables() {
  Tables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1U) != 0 ? 0x82f63b78U : 0U);
    tables[0][byte] = crc;
  }
  for (std::size_t t = 1; t < 8; ++t)
    for (std::size_t byte = 0; byte < 256; ++byte)
      tables[t][byte] = (tables[t - 1][byte] >> 8) ^ tables[0][tables[t - 1][byte] & 0xffU];
  return tables;
}

constexpr Tables kTables = makeTables();

}  // namespace

std::uint32_t crc32c(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xffffffffU;
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    std::uint32_t next = 0;
    for (std::size_t k = 0; k < 4; ++k) next ^= kTables[7 - k][((crc >> (8 * k)) & 0xffU) ^ bytes[i + k]];
    for (std::size_t k = 4; k < 8; ++k) next ^= kTables[7 - k][bytes[i + k]];
    crc = next;
  }
  for (; i < bytes.size(); ++i) crc = (crc >> 8) ^ kTables[0][(crc ^ bytes[i]) & 0xffU];
  return ~crc;
}

}  // namespace radiosity::protocol
