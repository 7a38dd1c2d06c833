// A photometric file (IES or EULUMDAT): a web that is sound and finite, or refused with a reason, at a bounded cost.
#include <cmath>

#include "server/scene/import/photometric_file.h"
#include "tests/fuzz/cost.h"
#include "tests/fuzz/target.h"

namespace radiosity::fuzz {
namespace {

constexpr double kMostSeconds = 5.0;
constexpr long kMostKilobytes = 128L << 10U;

std::string ies(const std::string& version, const std::string& tilt, int type, const std::string& angles,
                const std::string& candela) {
  return version + "\n[TEST] a\nTILT=" + tilt + "\n1 1000 1 3 2 " + std::to_string(type) + " 2 0 0 0\n1 1 40\n" +
         angles + "\n" + candela + "\n";
}

std::string eulumdat(int symmetry, int planes, int told) {
  std::string text = "maker\n1\n" + std::to_string(symmetry) + "\n" + std::to_string(planes) + "\n90\n3\n45\n";
  for (int i = 0; i < 14; ++i) text += "0\n";
  text += "100\n80\n1\n0\n1\n1\nLED\n2000\n3000\n80\n10\n";
  for (int i = 0; i < 10; ++i) text += "0.5\n";
  for (int i = 0; i < planes; ++i) text += std::to_string(360 / planes * i) + "\n";
  text += "0\n45\n90\n";
  for (int i = 0; i < 3 * told; ++i) text += std::to_string(100 - i) + ",5\n";
  return text;
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  for (const auto* version : {"IESNA:LM-63-1995", "IESNA:LM-63-2002", "IES:LM-63-2019", "IESNA91", "lamp"})
    all.push_back(seedOf(ies(version, "NONE", 1, "0 45 90\n0 90", "9 8 7 6 5 4")));
  all.push_back(seedOf(ies("IESNA91", "INCLUDE\n1\n2\n0 90\n1 0.9", 1, "0 90 180\n0 180", "9 8 7 6 5 4")));
  all.push_back(seedOf(ies("IESNA91", "lamp.tlt", 1, "0 90 180\n0 180", "9 8 7 6 5 4")));
  for (const int type : {2, 3}) all.push_back(seedOf(ies("IESNA91", "NONE", type, "-90 0 90\n0 90", "9 8 7 6 5 4")));
  all.push_back(seedOf(eulumdat(0, 4, 4)));
  all.push_back(seedOf(eulumdat(1, 4, 1)));
  for (const int symmetry : {2, 3}) all.push_back(seedOf(eulumdat(symmetry, 4, 3)));
  all.push_back(seedOf(eulumdat(4, 4, 2)));
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  const fuzz::Cost cost;
  const auto file = scene::parsePhotometricFile({data, size}, "fuzz.ies");
  cost.requireAtMost(fuzz::kMostSeconds, fuzz::kMostKilobytes);
  if (!file) {
    fuzz::require(!file.error().message.empty(), "a refusal says why");
    return 0;
  }
  const auto& table = file->web.table;
  fuzz::require(scene::isWebTable(table), "the web is a table");
  fuzz::require(std::isfinite(file->web.lumens) && file->web.lumens >= 0.0, "its lumens are a number");
  for (const float polar : {0.0F, 17.0F, 90.0F, 180.0F}) {
    for (const float azimuth : {-180.0F, -33.0F, 0.0F, 90.0F, 180.0F}) {
      const float candela = scene::webCandela(table, polar, azimuth);
      fuzz::require(candela >= 0.0F && std::isfinite(candela), "candela are numbers, none negative");
    }
  }
  return 0;
}
