// Runs a fuzz target without libFuzzer: every seed, then --runs N broken copies of them, the same ones each time; or
// the files named. With --write-seeds DIR it leaves the seeds there for libFuzzer.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/target.h"

namespace radiosity::fuzz {
namespace {

Seed readAll(const char* file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// Bits flipped, bytes replaced by those that matter in numbers and texts, pieces cut out, doubled, or taken from
/// another seed.
void mutate(Seed& bytes, const std::vector<Seed>& others, std::mt19937& random) {
  const auto pick = [&](std::size_t n) { return n == 0 ? std::size_t{0} : static_cast<std::size_t>(random() % n); };
  const auto at = [&](std::size_t i) { return bytes.begin() + static_cast<std::ptrdiff_t>(i); };
  for (auto edits = 1 + pick(4); edits > 0; --edits) {
    const auto place = pick(bytes.size());
    const auto length = std::min(bytes.size() - place, 1 + pick(16));
    switch (pick(6)) {
      case 0:
        if (!bytes.empty()) bytes[place] ^= static_cast<std::uint8_t>(1U << pick(8));
        break;
      case 1:
        if (!bytes.empty()) bytes[place] = static_cast<std::uint8_t>("\0\xff\x80\x7f-9e\"[{]}\\"[pick(13)]);
        break;
      case 2:
        bytes.erase(at(place), at(place + length));
        break;
      case 3: {
        const Seed piece(at(place), at(place + length));
        bytes.insert(at(pick(bytes.size())), piece.begin(), piece.end());
        break;
      }
      case 4:
        bytes.resize(place);
        break;
      default: {
        const auto& other = others[pick(others.size())];
        const auto from = pick(other.size());
        const auto count = std::min(other.size() - from, 1 + pick(64));
        bytes.insert(at(place), other.begin() + static_cast<std::ptrdiff_t>(from),
                     other.begin() + static_cast<std::ptrdiff_t>(from + count));
      }
    }
  }
}

int writeSeeds(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  int number = 0;
  for (const auto& seed : seeds()) {
    std::ofstream out(folder / ("seed-" + std::to_string(number++)), std::ios::binary);
    out.write(reinterpret_cast<const char*>(seed.data()), static_cast<std::streamsize>(seed.size()));
  }
  return 0;
}

void run(const Seed& bytes) { (void)LLVMFuzzerTestOneInput(bytes.data(), bytes.size()); }

int runAll(int runs) {
  const auto all = seeds();
  for (const auto& seed : all) run(seed);
  run({});
  std::mt19937 random(1);
  for (int i = 0; i < runs; ++i) {
    auto bytes = all[random() % all.size()];
    mutate(bytes, all, random);
    run(bytes);
  }
  std::printf("%zu seeds, %d broken copies\n", all.size(), runs);
  return 0;
}

}  // namespace
}  // namespace radiosity::fuzz

int main(int argc, char** argv) {
  using namespace radiosity::fuzz;  // NOLINT
  if (argc == 3 && std::strcmp(argv[1], "--write-seeds") == 0) return writeSeeds(argv[2]);
  if (argc == 3 && std::strcmp(argv[1], "--runs") == 0) return runAll(std::atoi(argv[2]));
  for (int i = 1; i < argc; ++i) run(readAll(argv[i]));
  return 0;
}
