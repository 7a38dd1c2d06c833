// OpenEXR files that are written into memory, for programs that link OpenEXR.
#pragma once

#include <ImfIO.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "common/bytes.h"

namespace radiosity {

/// Grows as it is written.
class ExrStream : public Imf::OStream {
 public:
  ExrStream() : Imf::OStream("lightmap.exr") {}
  void write(const char* data, int count) override {
    const std::size_t end = position_ + static_cast<std::size_t>(count);
    if (end > bytes.size()) bytes.resize(end);
    std::memcpy(bytes.data() + position_, data, static_cast<std::size_t>(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

  Bytes bytes;

 private:
  std::size_t position_ = 0;
};

}  // namespace radiosity
