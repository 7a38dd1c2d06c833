#include "server/solver/link_column.h"

#include <gtest/gtest.h>

#include <array>

#include <cmath>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

TEST(Link, KeepsElevenBitsOverThirtyTwoBinades) {
  for (float value = 3.9F; value > 0x1p-29F; value *= 0.9173F) {
    EXPECT_NEAR(decodeLink(encodeLink(value)) / value, 1.0F, 0x1p-12F) << value;
  }
}

TEST(Link, ZeroNegativeAndNoNumberAreNothingAndTooMuchIsTheMost) {
  for (const float none : {0.0F, -1.0F, std::nanf(""), 0x1p-40F}) EXPECT_EQ(encodeLink(none), 0U);
  EXPECT_EQ(decodeLink(0), 0.0F);
  EXPECT_EQ(decodeLink(encodeLink(1e30F)), decodeLink(0xffff));
  EXPECT_LE(decodeLink(0xffff), 4.0F);
}

class LinkColumns : public testing::Test {
 protected:
  LinkColumns()
      : made_(test::makeQuadScene(test::cubeQuads(4, {}, {}))),
        sides_(makeSides(*made_.patches)),
        expander_(*made_.patches, sides_) {}
  void add(LinkColumn& column, const LinkSample& sample, double points) {
    expander_.expand(sample);
    column.add(expander_, sample, points, sides_);
  }
  [[nodiscard]] float leaf(const LinkColumn& column, std::uint32_t side, std::uint32_t at) const {
    std::vector<float> leaves(sides_[side].leaf_count);
    return column.decode(sides_[side].first_value, leaves) ? leaves[at] : -1.0F;
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  LinkExpander expander_;
};

TEST_F(LinkColumns, SamplesAreAveragedByTheirPointsAlsoWhereOneOfThemSawNothing) {
  LinkSample first, second;
  first.add(sides_[1].first_node + 5, 0.5F);
  first.escaped = 0.25;
  second.add(sides_[1].first_node + 5, 0.125F);
  second.add(sides_[3].first_node, 0.25F);
  LinkColumn column;
  add(column, first, 1.0);
  add(column, second, 3.0);
  EXPECT_EQ(column.samples(), 2U);
  EXPECT_EQ(column.points(), 4.0);
  EXPECT_NEAR(leaf(column, 1, 5), 0.25 * 0.5 + 0.75 * 0.125, 1e-4);
  EXPECT_NEAR(leaf(column, 3, 0), 0.75 * 0.25, 1e-4);
  EXPECT_EQ(leaf(column, 1, 6), 0.0F);
  EXPECT_EQ(leaf(column, 0, 0), -1.0F) << "a side that nothing reached takes no memory";
  EXPECT_NEAR(column.escaped(), 0.0625, 1e-12);
}

TEST_F(LinkColumns, AreScaledToWhatShouldArriveInTheMeanOverAllSamples) {
  // One point of view finds too much, the other too little: each by itself would be scaled by 1/2 and by 2, and the
  // near leaf that both see alike would get 5/4 of its light.
  LinkSample first, second;
  first.add(sides_[1].first_node, 0.5F);
  first.delivered = 2.0;
  first.due = 1.0;
  second.add(sides_[1].first_node, 0.5F);
  second.delivered = 0.5;
  second.due = 1.0;
  LinkColumn column;
  add(column, first, 1.0);
  EXPECT_NEAR(column.gain(), 0.5, 1e-12);
  EXPECT_NEAR(leaf(column, 1, 0), 0.25, 1e-4);
  add(column, second, 1.0);
  EXPECT_NEAR(column.gain(), 0.8, 1e-12);
  EXPECT_NEAR(leaf(column, 1, 0), 0.4, 1e-4);
  EXPECT_NEAR(LinkColumn::product(column, column, std::vector<float>(made_.patches->nodeCount(), 1.0F)), 0.16, 1e-3);
}

TEST_F(LinkColumns, TinyAndHugeLinksAreKeptAlike) {
  for (const float size : {1e-25F, 1e-10F, 1.0F, 3e4F}) {
    LinkSample sample;
    sample.add(sides_[0].first_node, size);
    sample.add(sides_[0].first_node + 1, 1e-3F * size);
    LinkColumn column;
    add(column, sample, 1.0);
    LinkSample larger;
    larger.add(sides_[0].first_node, 100.0F * size);
    larger.add(sides_[0].first_node + 1, 1e-3F * size);
    add(column, larger, 1.0);
    EXPECT_NEAR(leaf(column, 0, 0) / (50.5F * size), 1.0, 5e-4) << size;
    EXPECT_NEAR(leaf(column, 0, 1) / (1e-3F * size), 1.0, 5e-4) << size;
  }
}

TEST_F(LinkColumns, TheMeanOfThousandsOfSamplesIsStillTheirMean) {
  LinkColumn column;
  LinkSample high, low;
  high.add(sides_[0].first_node, 1.0F);
  for (int i = 0; i < 10; ++i) add(column, high, 1.0);
  for (int i = 0; i < 9'990; ++i) add(column, low, 1.0);  // nothing was seen
  // 10 in 10,000. Rounded to nearest it would stay where a ten-thousandth of it is less than half a last bit.
  EXPECT_NEAR(leaf(column, 0, 0), 0.001, 0.0003);
}

TEST(LinkRuns, OfSmallSidesAreJoinedWhereZerosTakeLessThanARunOfTheirOwn) {
  std::vector<test::Quad> quads;
  for (int i = 0; i < 60; ++i)
    quads.push_back({{0.01F * static_cast<float>(i), 0, 0}, {0.01F, 0, 0}, {0, 0, 0.01F}, 1, 1, {}, {}});
  const auto made = test::makeQuadScene(quads);
  const auto sides = makeSides(*made.patches);
  LinkExpander expander(*made.patches, sides);
  const auto add = [&](LinkColumn& column, std::initializer_list<std::uint32_t> reached) {
    LinkSample sample;
    for (const auto s : reached) sample.add(sides[s].first_node, 0.5F);
    expander.expand(sample);
    column.add(expander, sample, 1.0, sides);
  };
  const auto link = [&](const LinkColumn& column, std::uint32_t s) {
    std::array<float, 1> value{};
    return column.decode(sides[s].first_value, value) ? value[0] : -1.0F;
  };
  LinkColumn column, other;
  add(column, {1, 3, 50});
  ASSERT_EQ(column.runs().size(), 2U);
  EXPECT_EQ(column.runs()[0].side_count, 3U);
  EXPECT_NEAR(link(column, 1), 0.5F, 1e-3F);
  EXPECT_EQ(link(column, 2), 0.0F);
  EXPECT_EQ(link(column, 30), -1.0F);
  add(column, {2, 5, 50});  // joins what was there
  ASSERT_EQ(column.runs().size(), 2U);
  EXPECT_EQ(column.runs()[0].side_count, 5U);
  for (const std::uint32_t s : {1U, 2U, 3U, 5U}) EXPECT_NEAR(link(column, s), 0.25F, 1e-3F) << s;
  EXPECT_EQ(link(column, 4), 0.0F);
  EXPECT_NEAR(link(column, 50), 0.5F, 1e-3F);
  add(other, {0, 5, 40, 50, 59});
  const std::vector<float> area(60, 2.0F);
  EXPECT_NEAR(LinkColumn::product(column, other, area), 2.0 * (0.25 * 0.5 + 0.5 * 0.5), 1e-3);
  EXPECT_NEAR(LinkColumn::product(other, column, area), 2.0 * (0.25 * 0.5 + 0.5 * 0.5), 1e-3);
}

TEST_F(LinkColumns, WhatACoarseNodeReceivesReachesAllLeavesBelowIt) {
  const Side& side = sides_[2];
  LinkSample sample;
  sample.add(nodeId(side, {2, 1, 1, 0}), 0.5F);  // leaves (2, 0) to (3, 1)
  sample.add(side.first_node + 2, 0.25F);
  LinkColumn column;
  add(column, sample, 1.0);
  EXPECT_NEAR(leaf(column, 2, 2), 0.75, 1e-4);
  EXPECT_NEAR(leaf(column, 2, 7), 0.5, 1e-4);
  EXPECT_EQ(leaf(column, 2, 1), 0.0F);
  add(column, {}, 1.0);  // and the next sample starts from nothing
  EXPECT_NEAR(leaf(column, 2, 7), 0.25, 1e-4);
}

TEST_F(LinkColumns, ApplyAddsRadiosityTimesLinksInEachChannel) {
  LinkSample sample;
  sample.add(sides_[4].first_node + 1, 0.5F);
  LinkColumn column;
  add(column, sample, 1.0);
  std::array<std::vector<float>, 3> planes;
  for (auto& plane : planes) plane.assign(96, 1.0F);
  column.apply({2.0F, 4.0F, -8.0F}, {planes[0].data(), planes[1].data(), planes[2].data()});
  const auto at = sides_[4].first_value + 1;
  EXPECT_EQ(planes[0][at], 2.0F);
  EXPECT_EQ(planes[1][at], 3.0F);
  EXPECT_EQ(planes[2][at], -3.0F);
  EXPECT_EQ(planes[0][at + 1], 1.0F);
}

TEST_F(LinkColumns, ProductsAreWeightedByArea) {
  LinkSample one, other;
  one.add(sides_[0].first_node, 0.5F);
  one.add(sides_[1].first_node, 0.5F);
  other.add(sides_[1].first_node, 0.25F);
  LinkColumn a, b;
  add(a, one, 1.0);
  add(b, other, 1.0);
  const std::vector<float> area(96, 2.0F);
  EXPECT_NEAR(LinkColumn::product(a, a, area), 2.0 * (0.25 + 0.25), 1e-4);
  EXPECT_NEAR(LinkColumn::product(a, b, area), 2.0 * 0.125, 1e-4);
  EXPECT_NEAR(LinkColumn::product(b, a, area), 2.0 * 0.125, 1e-4);
}

}  // namespace
}  // namespace radiosity::solver
