// The GLB container: a 12-byte header, a JSON chunk, at most one BIN chunk. Pure functions; any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::scene {

struct GlbChunks {
  std::string_view json;
  std::span<const std::uint8_t> bin;
  bool has_bin = false;
};

[[nodiscard]] bool isGlb(std::span<const std::uint8_t> bytes);

/// Views into `bytes`. Unknown chunks after the first are skipped, as the specification asks.
[[nodiscard]] Result<GlbChunks> splitGlb(const std::string& name, std::span<const std::uint8_t> bytes);

/// Whether so many bytes of either chunk are no more than a GLB can say that it has, 4 GiB.
[[nodiscard]] bool fitsGlb(std::size_t json, std::size_t bin);

/// Of what fitsGlb(). Pads JSON with spaces and BIN with zeros to 4 bytes. An empty `bin` gives no BIN chunk.
[[nodiscard]] Bytes joinGlb(std::string_view json, std::span<const std::uint8_t> bin);

}  // namespace radiosity::scene
