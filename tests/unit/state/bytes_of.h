// Contents of files, for tests.
#pragma once

#include <memory>
#include <string>

#include "common/bytes.h"

namespace radiosity::test {

inline SharedBytes bytesOf(const std::string& text) { return std::make_shared<const Bytes>(text.begin(), text.end()); }

}  // namespace radiosity::test
