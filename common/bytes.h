// Byte buffers that travel between threads without being copied.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace radiosity {

using Bytes = std::vector<std::uint8_t>;
using SharedBytes = std::shared_ptr<const Bytes>;

}  // namespace radiosity
