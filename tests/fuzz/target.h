// A fuzz target: takes any bytes and must neither crash nor break a claim that it checks itself. Each NAME_target.cpp
// defines one; it is linked with libFuzzer (`./dev fuzz`), or with replay_main.cpp, which needs nothing but a compiler.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace radiosity::fuzz {

using Seed = std::vector<std::uint8_t>;

/// Where to begin: small inputs that are right. Defined by each target.
[[nodiscard]] std::vector<Seed> seeds();

[[nodiscard]] inline Seed seedOf(const std::string& text) { return {text.begin(), text.end()}; }

/// A claim of the target; one that does not hold is a find, as a crash is.
inline void require(bool holds, const char* claim) {
  if (holds) return;
  std::fprintf(stderr, "broken claim: %s\n", claim);
  std::abort();
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
