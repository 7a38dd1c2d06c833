// Burial after an edit: leaves that are not looked at again have the bits that they would get, whatever is moved, comes
// or goes.
#include "server/scene/burial/burial_record.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/gtc/matrix_transform.hpp>
#include <random>

#include "server/scene/charts/build.h"
#include "server/scene/values/lineage.h"

namespace radiosity::scene {
namespace {

constexpr std::uint32_t kBox = 0, kLidless = 1, kRoom = 2, kLid = 4;

/// The unit cube about the origin, facing out, or without its lid, or only that, or facing in.
/// Posed, so that no wall cuts it: of a solid that is two instances, the other would lack the corners.
Primitive cube(std::uint32_t kind) {
  Primitive primitive;
  primitive.posed = true;
  primitive.mesh = kind;
  primitive.primitive = 0;
  primitive.material = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-0.5F, 0.5F}) {
      const bool is_lid = axis == 1 && side > 0.0F;
      if ((kind == kLidless && is_lid) || (kind == kLid && !is_lid)) continue;
      const auto first = static_cast<std::uint32_t>(primitive.positions.size());
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (const auto& [a, b] : {std::pair(-0.5F, -0.5F), {0.5F, -0.5F}, {0.5F, 0.5F}, {-0.5F, 0.5F}}) {
        glm::vec3 corner(0.0F);
        corner[axis] = side;
        corner[u] = a;
        corner[v] = b;
        primitive.positions.push_back(corner);
      }
      const bool turned = (side < 0.0F) != (kind == kRoom);
      for (const std::uint32_t i : {0U, 1U, 2U, 0U, 2U, 3U}) primitive.indices.push_back(first + (turned ? 3 - i : i));
    }
  }
  return primitive;
}

/// Within the unit cube, an L seen from above, facing out: its walls but for one, and caps, or that one.
Primitive angle(bool is_last_wall) {
  constexpr std::array<glm::dvec2, 6> kProfile{
      {{0.0, 0.0}, {-0.5, 0.0}, {-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {0.0, 0.5}}};  // the first is the inner corner
  Primitive primitive;
  primitive.mesh = 20;
  primitive.primitive = is_last_wall ? 1 : 0;
  primitive.material = is_last_wall ? 1 : 0;
  primitive.posed = true;
  const auto add = [&](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    for (const auto& corner : {a, b, c}) {
      primitive.indices.push_back(static_cast<std::uint32_t>(primitive.positions.size()));
      primitive.positions.push_back(corner);
    }
  };
  const auto at = [&](std::size_t i, double y) {
    const auto& place = kProfile[i % kProfile.size()];
    return glm::dvec3(place.x, y, -place.y);
  };
  for (std::size_t i = 0; i < kProfile.size(); ++i) {
    if (is_last_wall != (i + 1 == kProfile.size())) continue;
    add(at(i, -0.5), at(i + 1, -0.5), at(i + 1, 0.5));
    add(at(i, -0.5), at(i + 1, 0.5), at(i, 0.5));
  }
  for (std::size_t i = 1; i + 1 < kProfile.size() && !is_last_wall; ++i) {
    add(at(0, 0.5), at(i, 0.5), at(i + 1, 0.5));
    add(at(0, -0.5), at(i + 1, -0.5), at(i, -0.5));
  }
  return primitive;
}

class BurialRecords : public testing::Test {
 protected:
  BurialRecords() {
    scene_.materials.resize(2);
    scene_.materials[1].double_sided = true;
    scene_.primitives = {cube(kBox), cube(kLidless), cube(kRoom), cube(kBox), cube(kLid)};
    scene_.primitives.edit(3, [](Primitive& box) { box.mesh = 3, box.material = 1; });
    scene_.instances.push_back({.node = 0, .primitive = kRoom, .world = glm::scale(glm::dmat4(1.0), glm::dvec3(4.0))});
    for (std::uint32_t i = 1; i < 12; ++i) scene_.instances.push_back(placedAtRandom(i));
  }

  [[nodiscard]] double chance(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() % 65536U) / 65536.0;
  }

  /// On the floor, against a wall, half in it, or in the air; turned or not.
  Instance placedAtRandom(std::uint32_t node) {
    const glm::dvec3 size(chance(0.2, 1.2), chance(0.2, 1.2), chance(0.2, 1.2));
    glm::dvec3 at(chance(-1.8, 1.8), chance(-1.8, 1.8), chance(-1.8, 1.8));
    if (random_() % 2 == 0) at.y = -2.0 + 0.5 * size.y;
    if (random_() % 4 == 0) at.x = 2.0 - 0.3 * size.x;
    auto world = glm::translate(glm::dmat4(1.0), at);
    if (random_() % 2 == 0) world = glm::rotate(world, chance(0.0, 3.0), glm::dvec3(0, 1, 0));
    constexpr std::array<std::uint32_t, 4> kKinds = {kBox, kBox, kLidless, 3};
    return {.node = node, .primitive = kKinds[random_() % 4], .world = glm::scale(world, size)};
  }

  void editAtRandom() {
    const auto which = 1 + random_() % (scene_.instances.size() - 1);
    if (random_() % 4 == 0) {
      scene_.instances.push_back(placedAtRandom(next_node_++));
    } else if (random_() % 4 == 0 && scene_.instances.size() > 4) {
      scene_.instances.erase(scene_.instances.begin() + static_cast<std::ptrdiff_t>(which));
    } else if (random_() % 4 == 0) {  // what bounds solids, in the same place
      scene_.materials[random_() % 2].double_sided = random_() % 2 == 0;
    } else {
      auto kind = scene_.instances[which].primitive;
      scene_.instances[which] = placedAtRandom(scene_.instances[which].node);
      scene_.instances[which].primitive = kind;
    }
  }

  [[nodiscard]] BuiltScene build(const Scene& before, const BuiltScene& built, bool remembers = true) const {
    const FormerScene former{before, built.patches};
    return buildWithRecord(scene_, options_, &former, remembers ? built.burial.get() : nullptr).value();
  }

  static void expectSame(const PatchScene& a, const PatchScene& b) {
    EXPECT_EQ(a.node_area, b.node_area);
    ASSERT_EQ(a.spots.listCount(), b.spots.listCount());
    ASSERT_EQ(a.leaves.size(), b.leaves.size());
    for (std::size_t i = 0; i < a.leaves.size(); ++i) {
      const auto &leaf = a.leaves[i], &other = b.leaves[i];
      ASSERT_TRUE(leaf.texel == other.texel && leaf.triangle == other.triangle && leaf.full == other.full &&
                  leaf.spot_list == other.spot_list);
      if (!leaf.hasSpots()) continue;
      ASSERT_EQ(a.spotCount(leaf), b.spotCount(other));
      for (std::uint32_t k = 0; k < a.spotCount(leaf); ++k) {
        ASSERT_EQ(a.spot(leaf, k).texel, b.spot(other, k).texel);
        ASSERT_EQ(a.spot(leaf, k).triangle, b.spot(other, k).triangle);
      }
    }
  }

  /// The rays that decided, too.
  static void expectSame(const BurialRecord& a, const BurialRecord& b) {
    ASSERT_EQ(a.leaves.size(), b.leaves.size());
    for (std::size_t i = 0; i < a.leaves.size(); ++i) {
      const auto &one = a.leaves[i], &other = b.leaves[i];
      ASSERT_TRUE(one.leaf == other.leaf && one.side == other.side && one.pass == other.pass);
      ASSERT_TRUE(std::ranges::equal(one.found->fans, other.found->fans, {}, &RayFan::ways, &RayFan::ways))
          << "leaf " << one.leaf;
    }
  }

  /// Those that an edit left alone, too, are told from the former scene: as they would be by themselves.
  static void expectGapsOfAllLeaves(const PatchScene& patches) {
    auto anew = patches;
    for (auto& leaf : anew.leaves) {
      if (!leaf.full) continue;
      leaf.spot_list = kNone;
      leaf.cut = false;
    }
    placeSpotsInGaps(anew);
    for (std::size_t i = 0; i < patches.leaves.size(); ++i) {
      const auto &leaf = patches.leaves[i], &other = anew.leaves[i];
      ASSERT_TRUE(leaf.spot_list == other.spot_list && leaf.cut == other.cut) << "leaf " << i;
    }
  }

  /// The scene as it is now, built after that from before: with what was remembered, and without.
  void takeEdit(Scene& before, BuiltScene& built) const {
    auto next = build(before, built);
    const auto anew = build(before, built, false);
    ASSERT_NO_FATAL_FAILURE(expectSame(next.patches, anew.patches));
    expectGapsOfAllLeaves(next.patches);
    ASSERT_EQ(next.burial == nullptr, anew.burial == nullptr);  // where nothing is single-sided there are no solids
    if (next.burial) {
      ASSERT_NO_FATAL_FAILURE(expectSame(*next.burial, *anew.burial));
    }
    before = scene_;
    built = std::move(next);
  }

  Scene scene_;
  ChartOptions options_{.texel_budget = 6000, .sky = {}};
  std::mt19937 random_{7};
  std::uint32_t next_node_ = 100;
};

TEST_F(BurialRecords, RandomEditsGiveTheBitsOfLookingAtAllLeavesAgain) {
  auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  std::size_t buried = 0;
  for (int i = 0; i < 40; ++i) {
    editAtRandom();
    ASSERT_NO_FATAL_FAILURE(takeEdit(before, built)) << "edit " << i;
    for (std::size_t k = 0; built.burial && k < built.burial->leaves.size(); ++k)
      buried += built.burial->leaves[k].found->buried ? 1 : 0;
  }
  EXPECT_GT(buried, 2000U);
}

/// A leaf that was buried and comes free, far from the lid that was taken off: before it hovers something all along.
TEST_F(BurialRecords, ALeafThatComesFreeInAGapIsToldFromThoseThatWereFull) {
  scene_.instances.resize(1);
  const auto put = [&](std::uint32_t node, std::uint32_t kind, const glm::dvec3& at, double size) {
    scene_.instances.push_back(
        {.node = node, .primitive = kind, .world = glm::scale(glm::translate(glm::dmat4(1.0), at), glm::dvec3(size))});
  };
  put(1, kLidless, glm::dvec3(0.0), 2.4);
  put(2, kBox, {0.0, -0.8, 0.0}, 0.6);
  put(3, kBox, {0.63, -0.8, 0.0}, 0.6);  // 3 cm beside it
  put(4, kLid, glm::dvec3(0.0), 2.4);
  auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  const auto gapsBetween = [&] {  // on the first box
    std::size_t gaps = 0;
    for (const auto& surface : built.patches.surfaces) {
      for (std::uint32_t i = 0; surface.instance == 2 && i < surface.width * surface.height; ++i) {
        const auto& leaf = built.patches.leaves[surface.first_leaf + i];
        gaps +=
            leaf.full && leaf.spot_list == kFullSpots && built.patches.triangles[leaf.triangle].normal.x > 0.9F ? 1 : 0;
      }
    }
    return gaps;
  };
  EXPECT_EQ(gapsBetween(), 0U) << "all of it is buried";
  scene_.instances.pop_back();
  ASSERT_NO_FATAL_FAILURE(takeEdit(before, built));
  EXPECT_GT(gapsBetween(), 3U);
}

/// A lid that is taken off, and put back: what was a closed solid is open then, and its walls count for other places.
TEST_F(BurialRecords, ALidThatComesAndGoesGivesTheBitsOfLookingAtAllLeavesAgain) {
  constexpr std::size_t kLids = 5;
  for (std::size_t i = 1; i < 12; ++i) scene_.instances[i].primitive = i % 2 == 0 ? kLidless : kBox;
  for (std::uint32_t k = 0; k < kLids; ++k)
    scene_.instances.push_back({.node = 50 + k, .primitive = kLid, .world = scene_.instances[2 * (k + 1)].world});
  auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  const auto closed = built.patches.solids.bounds.size();
  EXPECT_EQ(closed, 11U);
  for (std::size_t k = 0; k < kLids; ++k) {
    auto& lid = scene_.instances[12 + k];
    const auto home = lid.world;
    for (const bool is_off : {true, false}) {
      lid.world = is_off ? glm::translate(home, glm::dvec3(0.1, 0.3, 0.0)) : home;
      ASSERT_NO_FATAL_FAILURE(takeEdit(before, built)) << k << is_off;
      EXPECT_EQ(built.patches.solids.bounds.size(), is_off ? closed - 1 : closed);
    }
  }
}

/// What is closed but for a sheet, and what fills a cavity.
TEST_F(BurialRecords, SolidsOfTwoMaterialsAndCavitiesGiveTheBitsOfLookingAtAllLeavesAgain) {
  auto walls = cube(kLidless), lid = cube(kLid), inner = cube(kRoom);
  lid.material = 1;
  walls.primitive = 0, lid.primitive = 1;
  walls.mesh = lid.mesh = inner.mesh = 9;
  for (const auto& primitive : {walls, lid, inner}) scene_.primitives.push_back(primitive);
  auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  for (std::uint32_t i = 0; i < 16; ++i) {
    const auto home = placedAtRandom(0).world;
    if (i % 4 == 3) {  // away again
      scene_.instances.pop_back();
    } else if (i % 4 == 2) {  // a cavity in the one before
      scene_.instances.push_back({.node = next_node_++,
                                  .primitive = 7,
                                  .world = glm::scale(scene_.instances[4 + i % 3].world, glm::dvec3(0.8))});
    } else {
      for (const std::uint32_t primitive : {5U, 6U})
        scene_.instances.push_back({.node = next_node_, .primitive = primitive, .world = home});
      ++next_node_;
    }
    ASSERT_NO_FATAL_FAILURE(takeEdit(before, built)) << i;
  }
}

/// Beside its inner corner a place lies in its bounds, but before none of its faces.
TEST_F(BurialRecords, AnAngleClosedByASheetGivesTheBitsOfLookingAtAllLeavesAgain) {
  for (const bool closes : {false, true}) scene_.primitives.push_back(angle(closes));
  auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  const auto closed = built.patches.solids.bounds.size();
  for (int i = 0; i < 12; ++i) {
    if (i % 2 == 1) {
      scene_.instances.resize(scene_.instances.size() - 2);
    } else {
      const auto home = placedAtRandom(0).world;
      for (const std::uint32_t primitive : {5U, 6U})
        scene_.instances.push_back({.node = next_node_, .primitive = primitive, .world = home});
      ++next_node_;
    }
    ASSERT_NO_FATAL_FAILURE(takeEdit(before, built)) << i;
    EXPECT_EQ(built.patches.solids.bounds.size(), i % 2 == 0 ? closed + 1 : closed);
  }
}

/// What is remembered is what counts: other numbers in the record come out again, of those that were buried far away.
TEST_F(BurialRecords, LeavesThatNoRayOfAnEditTouchesAreNotLookedAtAgain) {
  scene_.instances[5].primitive = kBox;
  const auto before = scene_;
  auto built = buildWithRecord(scene_, options_).value();
  auto record = *built.burial;
  for (auto& leaf : record.leaves) {
    if (!leaf.found->buried) continue;
    auto found = *leaf.found;
    found.buried->visible_area = 0.125F;
    leaf.found = std::make_shared<const BurialRecord::Found>(std::move(found));
  }
  built.burial = std::make_shared<const BurialRecord>(std::move(record));
  scene_.instances[5].world = glm::scale(  // half in the floor
      glm::translate(glm::dmat4(1.0), glm::dvec3(0.5, -2.0, 0.5)), glm::dvec3(0.3));
  const auto after = build(before, built);
  std::size_t remembered = 0, all = 0;
  for (const auto& leaf : after.burial->leaves) {
    if (!leaf.found->buried) continue;
    ++all;
    remembered += leaf.found->buried->visible_area == 0.125F ? 1 : 0;
  }
  EXPECT_GT(all, 100U);
  EXPECT_GT(remembered, all / 4);
  EXPECT_LT(remembered, all);
}

TEST(BurialWays, AreTheWaysThatFansSweep) {
  const glm::vec3 normal = glm::normalize(glm::vec3(0.2F, 0.9F, -0.3F));
  const BurialWays ways(normal);
  for (std::uint32_t way = 0; way < kBurialWays; ++way) {
    const glm::vec3 from(0.1F, 0.2F, 0.3F), there = from + 0.4F * glm::vec3(ways.of(way));
    RayNotes notes;
    notes.add({glm::dvec3(from), normal, kNone, way, kBurialRayLength});
    const std::array met{ChangedBox{there - 0.001F, there + 0.001F}};
    EXPECT_TRUE(notes.fans().front().mayMeet(met));
    const std::array behind{ChangedBox{2.0F * from - there - 0.001F, 2.0F * from - there + 0.001F}};
    EXPECT_FALSE(notes.fans().front().mayMeet(behind));
  }
}

}  // namespace
}  // namespace radiosity::scene
