// Grids of probes as JSON and as bytes, and JSON that is wrong.
#include "protocol/probes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

namespace radiosity::protocol {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

Probes someProbes() {
  ProbeGrid grid;
  grid.node = 7;
  grid.name = "room";
  grid.counts = {2, 1, 1};
  grid.first = {0.25, 0.5, 1.0};
  grid.steps = {{{0.5, 0.0, 0.0}, {0.0, 2.0, 0.0}, {0.0, 0.0, 3.0}}};
  for (std::size_t i = 0; i < 2 * kProbeNumbers; ++i) grid.values.push_back(0.5F * static_cast<float>(i));
  return {3, "converged", 0.02, {grid}};
}

std::string stringOf(const Bytes& bytes) { return {bytes.begin(), bytes.end()}; }
std::string textOf(const Probes& probes) { return stringOf(encodeHttpProbes(probes)); }
std::string bytesOf(const Probes& probes) { return stringOf(probesBinary(probes)); }

TEST(ProbesJson, HasListsOfAllProbesOneAfterTheOther) {
  const auto parsed = json::parse(textOf(someProbes()));
  EXPECT_EQ(parsed["revision"], 3);
  const auto& grid = parsed["grids"][0];
  EXPECT_EQ(grid["node"], 7);
  EXPECT_EQ(grid["counts"], json({2, 1, 1}));
  EXPECT_EQ(grid["steps"][1], json({0.0, 2.0, 0.0}));
  std::size_t offset = 0;
  for (const auto& list : kProbeLists) {
    const auto& found = grid[std::string(list.name)];
    ASSERT_EQ(found.size(), 2 * list.count) << list.name;
    EXPECT_EQ(found[0], 0.5 * static_cast<double>(offset)) << list.name;
    EXPECT_EQ(found[list.count], 0.5 * static_cast<double>(offset + kProbeNumbers)) << list.name;
    offset += list.count;
  }
}

TEST(ProbesJson, OfPlacesAloneHasNoListsAndIsReadBack) {
  auto probes = someProbes();
  probes.grids[0].values.clear();
  probes.grids.push_back(probes.grids[0]);
  probes.grids[1].node.reset();
  const auto text = textOf(probes);
  EXPECT_FALSE(json::parse(text)["grids"][0].contains("light"));
  const auto read = decodeHttpProbes(text);
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->grids.size(), 2U);
  EXPECT_EQ(read->grids[0].node, 7U);
  EXPECT_FALSE(read->grids[1].node);
  EXPECT_EQ(read->grids[0].counts, probes.grids[0].counts);
  EXPECT_EQ(read->grids[0].steps, probes.grids[0].steps);
  EXPECT_EQ(read->grids[0].first, probes.grids[0].first);
}

TEST(ProbesJson, IsJsonWhateverTheNumbers) {
  auto probes = someProbes();
  probes.grids[0].values[0] = std::numeric_limits<float>::quiet_NaN();
  probes.grids[0].values[1] = std::numeric_limits<float>::infinity();
  const auto parsed = json::parse(textOf(probes));
  EXPECT_EQ(parsed["grids"][0]["light"][0], 0.0);
  EXPECT_GT(parsed["grids"][0]["light"][1], 1e38);
}

TEST(ProbesJson, ThatIsWrongIsRefusedByItsPlace) {
  const auto refusedFor = [](const std::string& pointer, const json& value) {
    auto parsed = json::parse(textOf(someProbes()));
    parsed[json::json_pointer(pointer)] = value;
    const auto read = decodeHttpProbes(parsed.dump());
    ASSERT_FALSE(read) << pointer;
    EXPECT_THAT(read.error().where, HasSubstr(pointer));
  };
  refusedFor("/revision", -1);
  refusedFor("/grids", 3);
  refusedFor("/grids/0/counts", json({2, 1}));
  refusedFor("/grids/0/counts", json({2, 1, 0}));
  refusedFor("/grids/0/counts", json({2, 1.5, 1}));
  refusedFor("/grids/0/first", "here");
  refusedFor("/grids/0/steps", json({{1, 2, 3}, {1, 2, 3}}));
  refusedFor("/grids/0/steps/2", json({1, 2}));
}

TEST(ProbesHead, IsReadFromTheStartOfEitherForm) {
  auto probes = someProbes();
  probes.grids[0].values[kProbeNumbers - 1] = 0.0F;
  probes.grids.push_back(probes.grids[0]);
  probes.grids[1].values[2 * kProbeNumbers - 1] = 0.0F;
  for (const auto& file : {textOf(probes), bytesOf(probes)}) {
    const auto head = decodeProbesHead(std::string_view(file).substr(0, 1000));
    ASSERT_TRUE(head) << head.error().text();
    EXPECT_EQ(head->revision, 3U);
    EXPECT_EQ(head->measured, (std::vector<std::uint64_t>{1, 2}));
  }
  for (const char* wrong : {"", "RPRB", "{}", "RPRB\1\1\1\1\1\1\1\1{"}) EXPECT_FALSE(decodeProbesHead(wrong)) << wrong;
}

TEST(ProbesBinary, HasAHeaderOfJsonAndThenFloats) {
  const auto probes = someProbes();
  const auto bytes = bytesOf(probes);
  ASSERT_EQ(bytes.substr(0, 4), "RPRB");
  std::uint32_t version = 0, size = 0;
  std::memcpy(&version, bytes.data() + 4, 4);
  std::memcpy(&size, bytes.data() + 8, 4);
  EXPECT_EQ(version, 1U);
  EXPECT_EQ(size % 4, 0U);
  ASSERT_EQ(bytes.size(), 12 + size + 2 * kProbeNumbers * sizeof(float));
  EXPECT_EQ(json::parse(bytes.substr(12, size))["grids"][0]["counts"], json({2, 1, 1}));
  std::vector<float> values(2 * kProbeNumbers);
  std::memcpy(values.data(), bytes.data() + 12 + size, values.size() * sizeof(float));
  EXPECT_EQ(values, probes.grids[0].values);
}

}  // namespace
}  // namespace radiosity::protocol
