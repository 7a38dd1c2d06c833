#include "server/solver/transport/link_column.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

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
        areas_(leafAreas(*made_.patches, sides_)),
        expander_(*made_.patches, sides_) {}
  void add(LinkColumn& column, const LinkSample& sample, double points) {
    expander_.expand(sample);
    column.add(expander_, sample, points, areas_, sides_);
  }
  [[nodiscard]] float leaf(const LinkColumn& column, std::uint32_t side, std::uint32_t at) const {
    std::vector<float> leaves(sides_[side].leaf_count);
    return column.decode(sides_[side].first_value, leaves) ? leaves[at] : -1.0F;
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::vector<float> areas_;
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
  constexpr double kLeaf = 1.0 / 16.0;  // area
  LinkSample first, second;
  first.add(sides_[1].first_node, 0.5F);
  first.add(sides_[1].first_node + 1, 1.5F);
  first.due = kLeaf;
  second.add(sides_[1].first_node, 0.5F);
  second.due = kLeaf;
  LinkColumn column;
  add(column, first, 1.0);
  EXPECT_NEAR(column.gain(), 0.5, 1e-6);
  EXPECT_NEAR(leaf(column, 1, 0), 0.25, 1e-4);
  add(column, second, 1.0);
  EXPECT_NEAR(column.gain(), 0.8, 1e-6);
  EXPECT_NEAR(leaf(column, 1, 0), 0.4, 1e-4);
  EXPECT_NEAR(LinkColumn::product(column, column, std::vector<float>(made_.patches->nodeCount(), 1.0F)),
              0.4 * 0.4 + 0.6 * 0.6, 1e-3);
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
  const auto areas = leafAreas(*made.patches, sides);
  LinkExpander expander(*made.patches, sides);
  const auto add = [&](LinkColumn& column, std::initializer_list<std::uint32_t> reached) {
    LinkSample sample;
    for (const auto s : reached) sample.add(sides[s].first_node, 0.5F);
    expander.expand(sample);
    column.add(expander, sample, 1.0, areas, sides);
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

/// Flux of all links for a radiosity of one.
double fluxOf(const LinkColumn& column, const std::vector<Side>& sides, std::span<const float> leaf_area) {
  double flux = 0.0;
  for (const auto& side : sides) {
    std::vector<float> leaves(side.leaf_count);
    if (!column.decode(side.first_value, leaves)) continue;
    for (std::uint32_t i = 0; i < side.leaf_count; ++i)
      flux += static_cast<double>(leaves[i]) * static_cast<double>(leaf_area[side.first_value + i]);
  }
  return flux;
}

TEST_F(LinkColumns, OneInWhichLinksWereReplacedIsTheOneMadeOfThemAfresh) {
  const auto set = [&](LinkSample& sample, std::uint32_t side, std::uint32_t leaf, float value) {
    sample.add(sides_[side].first_node + leaf, value);
  };
  LinkSample before, after;
  for (std::uint32_t leaf = 0; leaf < 16; ++leaf) {
    const float value = 0.01F + 0.003F * static_cast<float>(leaf);
    set(before, 1, leaf, value);
    set(after, 1, leaf, leaf < 4 ? 0.5F * value : value);  // darker
  }
  set(before, 2, 3, 0.02F);  // will be hidden
  set(after, 4, 7, 0.9F);    // was hidden; by far the largest, so that the scale must grow
  before.due = 0.04, before.escaped = 0.01;
  after.due = 0.05, after.absorbed = 0.002;
  LinkColumn replaced, afresh;
  add(replaced, before, 3.0);
  add(afresh, after, 3.0);
  expander_.expand(after);
  std::vector<float> values(areas_.size(), 0.0F);
  for (const auto s : expander_.sidesReached()) {
    for (auto v = sides_[s].first_value; v < sides_[s].first_value + sides_[s].leaf_count; ++v)
      values[v] = expander_.values()[v];
  }
  const std::vector<LinkColumn::ValueRun> leaves = {
      {sides_[1].first_value, 4}, {sides_[2].first_value + 2, 3}, {sides_[4].first_value, 16}};
  replaced.replace(leaves, values, {after.due, after.escaped, after.absorbed, {}}, areas_, sides_);
  for (std::uint32_t side = 0; side < 6; ++side) {
    for (std::uint32_t i = 0; i < 16; ++i) {
      const float was = std::max(0.0F, leaf(replaced, side, i)), is = std::max(0.0F, leaf(afresh, side, i));
      EXPECT_NEAR(was, is, 0x1p-10F * is) << side << ", " << i;  // two roundings of 2^-12, and that of the gain
    }
  }
  EXPECT_EQ(leaf(replaced, 2, 3), 0.0F);
  EXPECT_EQ(replaced.points(), afresh.points());
  EXPECT_EQ(replaced.escaped(), 0.0);
  EXPECT_EQ(replaced.absorbed(), afresh.absorbed());
  EXPECT_NEAR(fluxOf(replaced, sides_, areas_), after.due, 1e-6);
}

TEST_F(LinkColumns, WhereNothingReachesALeafReplacingItTakesNoMemory) {
  LinkSample sample;
  sample.add(sides_[1].first_node, 0.5F);
  LinkColumn column;
  add(column, sample, 1.0);
  const auto bytes = column.bytes();
  const std::vector<float> values(96, 0.0F);
  const std::vector<LinkColumn::ValueRun> leaves = {{sides_[3].first_value, 16}, {sides_[5].first_value + 4, 2}};
  column.replace(leaves, values, {1.0 / 32.0, 0.0, 0.0, {}}, areas_, sides_);
  EXPECT_EQ(column.bytes(), bytes);
  EXPECT_EQ(leaf(column, 3, 0), -1.0F);
  EXPECT_NEAR(leaf(column, 1, 0), 0.5, 1e-6);
}

TEST_F(LinkColumns, KnowsFromWhichPointsSomethingWasLost) {
  LinkSample sample;
  sample.add(sides_[1].first_node, 0.5F);
  LinkColumn column;
  add(column, sample, 3.0);
  EXPECT_EQ(column.openLooks().bits, 0U);
  sample.escaped = 0.25;
  sample.open_looks.add(1);
  add(column, sample, 2.0);
  EXPECT_EQ(column.openLooks().bits, 1U << 4U) << "the second of two, after three";
  EXPECT_EQ(column.openLooks().from(3, 2).bits, 2U);
  sample.open_looks = {};
  add(column, sample, 1.0);
  EXPECT_TRUE(column.openLooks().has(5)) << "it does not say which: all";
  add(column, sample, 100.0);
  for (const std::uint32_t look : {6U, 62U, 63U, 105U, 1000U}) EXPECT_TRUE(column.openLooks().has(look)) << look;
  EXPECT_FALSE(column.openLooks().has(0));
}

TEST_F(LinkColumns, OneThatWasRenumberedIsTheOneMadeInTheNewNumbers) {
  // Of six sides the third is gone, and a smaller one has come before the second.
  auto quads = test::cubeQuads(4, {}, {});
  auto extra = quads[0];
  extra.width = extra.height = 2;
  quads.erase(quads.begin() + 2);
  quads.insert(quads.begin() + 1, extra);
  const auto made = test::makeQuadScene(quads);
  const auto sides = makeSides(*made.patches);
  const std::vector<std::uint32_t> side_after = {0, 2, scene::kNone, 3, 4, 5};
  LinkSample before, after;
  for (std::uint32_t side = 0; side < 5; ++side) {  // nothing reaches the last
    for (std::uint32_t i = 0; i < 16; ++i) {
      const float value = 0.02F + 0.001F * static_cast<float>(16 * side + i);
      before.add(sides_[side].first_node + i, value);
      if (side_after[side] != scene::kNone) after.add(sides[side_after[side]].first_node + i, value);
    }
  }
  before.due = 0.25, before.escaped = 0.03;
  after.due = 0.2, after.escaped = 0.03;
  LinkColumn column, afresh;
  add(column, before, 2.0);
  const auto original = column;
  column = column.renumbered(side_after, sides_, sides);
  for (std::uint32_t side = 0; side < 6; ++side) {
    std::vector<float> was(16), is(16);
    const bool had = original.decode(sides_[side].first_value, was);
    if (side_after[side] == scene::kNone) continue;
    EXPECT_EQ(column.decode(sides[side_after[side]].first_value, is), had) << side;
    EXPECT_EQ(is, was) << side;  // to the bit, with the gain that all links together had
  }
  std::vector<float> small(4);
  EXPECT_FALSE(column.decode(sides[1].first_value, small)) << "nothing is known of what is new";
  EXPECT_EQ(column.points(), 2.0);
  EXPECT_EQ(column.escaped(), 0.03);
  EXPECT_LT(column.bytes(), original.bytes());
  // With nothing to replace but what should arrive it is the column of the new scene, and keeps its flux.
  const auto areas = leafAreas(*made.patches, sides);
  LinkExpander expander(*made.patches, sides);
  expander.expand(after);
  afresh.add(expander, after, 2.0, areas, sides);
  column.replace({}, {}, {after.due, after.escaped, 0.0, {}}, areas, sides);
  EXPECT_NEAR(fluxOf(column, sides, areas), after.due, 1e-6);
  for (const auto& side : sides) {
    std::vector<float> one(side.leaf_count, 0.0F), other(side.leaf_count, 0.0F);
    // Where there is none, one of them may keep zeros between runs.
    (void)column.decode(side.first_value, one);
    (void)afresh.decode(side.first_value, other);
    for (std::uint32_t i = 0; i < side.leaf_count; ++i) EXPECT_NEAR(one[i], other[i], 0x1p-10F * other[i]);
  }
}

TEST_F(LinkColumns, WhatIsRenumberedStaysAsItIsWhenTheOtherChanges) {
  const std::vector<std::uint32_t> same = {0, 1, 2, 3, 4, 5};
  LinkSample sample;
  for (std::uint32_t side = 0; side < 6; ++side) {
    for (std::uint32_t i = 0; i < 16; ++i)
      sample.add(sides_[side].first_node + i, 0.02F + 0.001F * static_cast<float>(i));
  }
  const auto linksOf = [&](const LinkColumn& column) {
    std::vector<float> links(6 * 16);
    for (std::uint32_t side = 0; side < 6; ++side)
      EXPECT_TRUE(column.decode(sides_[side].first_value, std::span(links).subspan(16 * side, 16)));
    return links;
  };
  LinkSample brighter = sample;
  for (auto& value : brighter.irradiance) value *= 3.0F;
  const std::vector<float> values(6 * 16, 0.5F);
  const std::vector<LinkColumn::ValueRun> leaves = {{sides_[1].first_value, 16}};
  const std::vector<float> areas(6 * 16, 0.01F);
  // By another sample, by a larger one (which scales the codes of all), and by other links to some leaves.
  for (int change = 0; change < 3; ++change) {
    for (const bool of_copy : {false, true}) {
      LinkColumn column;
      add(column, sample, 2.0);
      auto copy = column.renumbered(same, sides_, sides_);
      const auto before = linksOf(column);
      EXPECT_EQ(linksOf(copy), before);
      auto& changed = of_copy ? copy : column;
      if (change == 2) {
        changed.replace(leaves, values, {0.25, 0.0, 0.0, {}}, areas, sides_);
      } else {
        add(changed, change == 0 ? sample : brighter, 1.0);
      }
      EXPECT_EQ(linksOf(of_copy ? column : copy), before) << change;
      EXPECT_EQ(change == 0 || linksOf(changed) != before, true) << change;
    }
  }
}

}  // namespace
}  // namespace radiosity::solver
