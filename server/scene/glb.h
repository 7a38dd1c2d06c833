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

/// Pads JSON with spaces and BIN with zeros to 4 bytes. An empty `bin` gives no BIN chunk.
[[nodiscard]] Bytes joinGlb(std::string_view json, std::span<const std::uint8_t> bin);

}  // namespace radiosity::scene
