// What Embree tells by way of RayScene, against the triangles one by one in double precision.
#include "server/geometry/ray_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <random>
#include <utility>

#include "server/geometry/same_triangles.h"

namespace radiosity::geometry {
namespace {

std::vector<Triangle> soup(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-0.5F, 0.5F);
  std::vector<Triangle> triangles(count);
  for (auto& triangle : triangles) {
    const glm::vec3 centre(uniform(random), uniform(random), uniform(random));
    for (auto& corner : triangle) corner = centre + 0.2F * glm::vec3(uniform(random), uniform(random), uniform(random));
  }
  return triangles;
}

RayScene sceneOf(std::span<const Triangle> triangles, const std::vector<bool>& see_through = {},
                 std::shared_ptr<const SeeThrough> passes = nullptr) {
  auto built = RayScene::build(triangles, 1, see_through, std::move(passes));
  EXPECT_TRUE(built.has_value());
  return built ? *built : RayScene();
}

/// How far into the triangle a ray passes, in parts of its size; negative: beside it.
struct Meeting {
  double t, inside;
  bool front;
};
Meeting meet(const Triangle& triangle, const glm::dvec3& origin, const glm::dvec3& direction) {
  const glm::dvec3 a(triangle[0]), e1 = glm::dvec3(triangle[1]) - a, e2 = glm::dvec3(triangle[2]) - a;
  const auto p = glm::cross(direction, e2), s = origin - a, q = glm::cross(s, e1);
  const double determinant = glm::dot(e1, p), u = glm::dot(s, p) / determinant,
               v = glm::dot(direction, q) / determinant;
  return {glm::dot(e2, q) / determinant, std::min({u, v, 1.0 - u - v}), determinant > 0.0};
}

struct Expected {
  double t = 1e30;
  std::uint32_t triangle = kNoTriangle;
  bool front = false, doubtful = false;  ///< rounding may decide otherwise
};
Expected nearestOf(std::span<const Triangle> triangles, const Ray& ray) {
  Expected nearest;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const auto met = meet(triangles[i], glm::dvec3(ray.origin), glm::dvec3(ray.direction));
    const bool near_edge = std::abs(met.inside) < 1e-4, near_end = std::abs(met.t - ray.reach) < 1e-5;
    nearest.doubtful = nearest.doubtful || (met.t > -1e-5 && (near_edge || near_end)) || std::abs(met.t) < 1e-5;
    if (met.inside < 0.0 || met.t <= 0.0 || met.t >= ray.reach || met.t >= nearest.t) continue;
    nearest.t = met.t;
    nearest.triangle = i;
    nearest.front = met.front;
  }
  return nearest;
}

std::vector<Ray> raysThrough(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-0.5F, 0.5F);
  std::vector<Ray> rays(count);
  for (std::size_t i = 0; i < count; ++i) {
    rays[i].origin = {uniform(random), uniform(random), uniform(random)};
    rays[i].direction = {uniform(random), uniform(random), uniform(random)};
    if (i % 10 == 0) rays[i].direction = {0.0F, 1.0F, 0.0F};
    rays[i].reach = i % 2 == 0 ? 4.0F : 0.1F;
  }
  return rays;
}

TEST(RayScene, MeetsWhatDoublePrecisionMeets) {
  for (const std::size_t count : {1U, 7U, 65U, 700U}) {
    const auto triangles = soup(count, 3);
    const auto scene = sceneOf(triangles);
    std::size_t met = 0, missed = 0;
    for (const auto& ray : raysThrough(2000, 5)) {
      const auto expected = nearestOf(triangles, ray);
      if (expected.doubtful) continue;
      const auto hit = scene.nearest(ray);
      ASSERT_EQ(hit.triangle, expected.triangle) << count;
      (hit.found() ? met : missed) += 1;
      if (!hit.found()) continue;
      EXPECT_NEAR(hit.t, expected.t, 1e-5);
      EXPECT_EQ(hit.front, expected.front);
    }
    EXPECT_GT(missed, 100U) << count;
    EXPECT_GT(met, count > 60 ? 50U : 0U);
  }
}

TEST(RayScene, PacketsMeetWhatSingleRaysMeet) {
  const auto triangles = soup(700, 3);
  const auto scene = sceneOf(triangles);
  const auto rays = raysThrough(4003, 7);
  std::size_t differ = 0;
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    const auto some = std::span(rays).subspan(first, std::min(kPacket, rays.size() - first));
    std::array<Hit, kPacket> hits;
    scene.nearest(some, std::span(hits).first(some.size()));
    for (std::size_t i = 0; i < some.size(); ++i) {
      const auto single = scene.nearest(some[i]);
      differ += single.triangle != hits[i].triangle || single.front != hits[i].front ? 1 : 0;
      if (single.found() && hits[i].found()) {
        EXPECT_NEAR(single.t, hits[i].t, 1e-5);
      }
    }
  }
  EXPECT_LE(differ, 2U);  // at an edge, where rounding decides
}

TEST(RayScene, OfWhatCoincidesTheFrontIsMetThenTheFirst) {
  const Triangle one{glm::vec3(-1, 0, -1), glm::vec3(1, 0, 1), glm::vec3(1, 0, -1)};  // shows its front from above
  const Triangle turned{one[0], one[2], one[1]};
  const Ray down{{0.5F, 1.0F, -0.2F}, {0, -1, 0}, 4.0F}, up{{0.5F, -1.0F, -0.2F}, {0, 1, 0}, 4.0F};
  for (const auto& triangles : {std::vector{one, turned}, std::vector{turned, one}}) {
    const auto scene = sceneOf(triangles);
    const std::uint32_t first = triangles[0] == one ? 0 : 1;
    EXPECT_EQ(scene.nearest(down).triangle, first);
    EXPECT_EQ(scene.nearest(up).triangle, 1 - first);
    EXPECT_TRUE(scene.nearest(down).front && scene.nearest(up).front);
  }
  const std::vector<Triangle> many(100, one);
  const auto scene = sceneOf(many);
  EXPECT_EQ(scene.nearest(down).triangle, 0U);
  const std::array<std::uint32_t, 2> passed{0, 1};
  EXPECT_EQ(scene.nearest(down, passed).triangle, 2U);
  auto own = down;
  own.own = 0;
  EXPECT_EQ(scene.nearest(own).triangle, 1U);
  const std::vector rays(kPacket, own);
  std::array<Hit, kPacket> hits;
  scene.nearest(rays, hits);
  for (const auto& hit : hits) EXPECT_EQ(hit.triangle, 1U);
}

TEST(RayScene, OpenIsWhatNothingIsMetOn) {
  const auto triangles = soup(300, 9);
  const auto scene = sceneOf(triangles);
  const auto rays = raysThrough(4000, 11);
  std::size_t open = 0;
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    Ways ways{};
    for (std::size_t i = 0; i < kPacket; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        ways.origin[static_cast<std::size_t>(axis)][i] = rays[first + i].origin[axis];
        ways.direction[static_cast<std::size_t>(axis)][i] = rays[first + i].direction[axis];
      }
    }
    const auto bits = scene.open(ways);
    for (std::size_t i = 0; i < kPacket; ++i) {
      auto ray = rays[first + i];
      ray.reach = 1.0F;
      const auto expected = nearestOf(triangles, ray);
      if (expected.doubtful) continue;
      EXPECT_EQ((bits >> i & 1U) != 0, expected.triangle == kNoTriangle);
      open += bits >> i & 1U;
    }
    EXPECT_EQ(scene.open(ways, 3), bits & 7U);
  }
  EXPECT_GT(open, 100U);
  EXPECT_LT(open, 3900U);
}

/// Half of the ways pass, and all of them left of the middle.
class Blinds final : public SeeThrough {
 public:
  [[nodiscard]] bool passes(std::uint32_t triangle, float u, float /*v*/, const glm::vec3& /*direction*/,
                            std::uint64_t key) const override {
    return triangle == 1 && (u < 0.25F || key % 2 == 0);
  }
};

TEST(RayScene, WhatOneCanSeeThroughIsAsked) {
  const Triangle pane{glm::vec3(-1, 0, -1), glm::vec3(3, 0, -1), glm::vec3(-1, 0, 3)};
  const Triangle wall{glm::vec3(-1, -1, -1), glm::vec3(0, -1, -1), glm::vec3(-1, -1, 3)};
  const auto scene = sceneOf(std::vector{wall, pane}, {false, true}, std::make_shared<Blinds>());
  Ways ways{};
  for (std::size_t i = 0; i < kPacket; ++i) {
    ways.origin[0][i] = i < 4 ? -0.9F : 0.9F;  // u = 0.025, 0.475
    ways.origin[1][i] = 1.0F;
    ways.direction[1][i] = i % 4 < 2 ? -1.5F : -3.0F;  // the wall lies below the pane, on the left alone
    ways.key[i] = i;
  }
  EXPECT_EQ(scene.open(ways), 0b01010011U);
  EXPECT_EQ(scene.nearest(Ray{{-0.9F, 1, 0}, {0, -1, 0}, 4.0F}).triangle, 1U);  // it is met all the same
  EXPECT_TRUE(scene.open(Ray{{0.9F, 1, 0}, {0, -1, 0}, 4.0F}));
  EXPECT_FALSE(scene.open(Ray{{-0.9F, 1, 0}, {0, -1, 0}, 4.0F}));  // the wall
}

/// Soup of which each piece is there `copies` times, far apart in the order.
std::vector<Triangle> copiedSoup(std::size_t count, std::size_t copies, std::uint32_t seed) {
  const auto once = soup(count, seed);
  std::vector<Triangle> triangles;
  for (std::size_t copy = 0; copy < copies; ++copy) triangles.insert(triangles.end(), once.begin(), once.end());
  return triangles;
}

TEST(RayScene, CopiesAreMetOneAfterTheOther) {
  constexpr std::uint32_t kCount = 60, kCopies = 9;
  const auto once = sceneOf(soup(kCount, 3)), all = sceneOf(copiedSoup(kCount, kCopies, 3));
  std::size_t met = 0;
  for (auto ray : raysThrough(2000, 5)) {
    const auto expected = once.nearest(ray);
    std::vector<std::uint32_t> passed;
    for (std::uint32_t copy = 0; expected.found() && copy < kCopies; ++copy) {
      const auto hit = all.nearest(ray, passed);
      ASSERT_EQ(hit.triangle, expected.triangle + copy * kCount);
      EXPECT_EQ(hit.t, expected.t);
      EXPECT_EQ(hit.front, expected.front);
      if (copy == 3) ray.own = hit.triangle;  // it may stand anywhere among those that are passed
      if (copy != 3) passed.push_back(hit.triangle);
      ++met;
    }
    if (!expected.found()) continue;
    const auto own = std::exchange(ray.own, kNoTriangle);
    passed.push_back(own);
    const auto beyond = all.nearest(ray, passed);
    EXPECT_TRUE(!beyond.found() || beyond.triangle % kCount != expected.triangle);
  }
  EXPECT_GT(met, 500U);
}

/// Each ray of a packet passes by another copy of its own.
TEST(RayScene, InPacketsCopiesAreMetAsByRaysAlone) {
  constexpr std::uint32_t kCount = 60, kCopies = 5;
  const auto all = sceneOf(copiedSoup(kCount, kCopies, 3));
  std::vector<Ray> rays = raysThrough(512 * kPacket, 5);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto met = all.nearest(rays[i]);
    if (met.found()) rays[i].own = met.triangle + static_cast<std::uint32_t>(i % kCopies) * kCount;
  }
  std::size_t found = 0;
  for (std::size_t first = 0; first < rays.size(); first += kPacket) {
    std::array<Hit, kPacket> hits;
    all.nearest(std::span(rays).subspan(first, kPacket), hits);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const auto alone = all.nearest(rays[first + i]);
      EXPECT_EQ(hits[i].triangle, alone.triangle);
      EXPECT_EQ(hits[i].front, alone.front);
      found += alone.found() ? 1 : 0;
    }
  }
  EXPECT_GT(found, 64U);
}

/// One copy of all lets nothing pass where its key says so.
class OneOpaqueCopy final : public SeeThrough {
 public:
  [[nodiscard]] bool passes(std::uint32_t triangle, float /*u*/, float /*v*/, const glm::vec3& /*direction*/,
                            std::uint64_t key) const override {
    return triangle != key;
  }
};

TEST(RayScene, EachCopyOfWhatOneCanSeeThroughIsAsked) {
  const Triangle pane{glm::vec3(-1, 0, -1), glm::vec3(3, 0, -1), glm::vec3(-1, 0, 3)};
  const auto scene =
      sceneOf(std::vector<Triangle>(7, pane), std::vector<bool>(7, true), std::make_shared<OneOpaqueCopy>());
  Ways ways{};
  for (std::size_t i = 0; i < kPacket; ++i) {
    ways.origin[1][i] = 1.0F;
    ways.direction[1][i] = -2.0F;
    ways.key[i] = i;
  }
  EXPECT_EQ(scene.open(ways), 0b10000000U);  // there is no copy 7
}

TEST(SameTriangles, AreToldFromThoseThatDifferAtAll) {
  const auto a = soup(1, 3)[0];
  auto nearly = a;
  nearly[2].z = std::nextafter(nearly[2].z, 1.0F);
  const Triangle turned{a[1], a[2], a[0]};
  EXPECT_TRUE(findSame(std::vector{a, nearly, turned}).next.empty());
  const auto same = findSame(std::vector{a, nearly, a, turned, a, nearly}, {false, false, false, false, true, false});
  EXPECT_EQ(same.next, (std::vector{2U, 5U, kNoTriangle, kNoTriangle, kNoTriangle, kNoTriangle}));
  EXPECT_EQ(same.follows, (std::vector{false, false, true, false, false, true}));
}

/// Of crowded hashes each copy was left in the tree, where a ray that meets one meets all.
TEST(SameTriangles, AreToldWhereCornersAreChosenSoThatHashesCrowd) {
  constexpr std::size_t kCrowd = 100, kPlaces = 1024;  // the least table for three of each
  std::vector<Triangle> crowd;
  for (const auto& triangle : soup(2 * kCrowd * kPlaces, 2)) {
    if (hashOfCorners(triangle) % kPlaces == 0 && crowd.size() < kCrowd) crowd.push_back(triangle);
  }
  ASSERT_EQ(crowd.size(), kCrowd);
  std::vector<Triangle> all;
  for (int copy = 0; copy < 3; ++copy) all.insert(all.end(), crowd.begin(), crowd.end());
  std::vector<bool> kind(all.size(), false);
  kind[1] = true;
  const auto same = findSame(all, kind);
  ASSERT_EQ(same.next.size(), all.size());
  for (std::uint32_t i = 0; i < all.size(); ++i) {
    const bool is_last = i + kCrowd >= all.size() || i == 1;
    ASSERT_EQ(same.next[i], is_last ? kNoTriangle : i + kCrowd) << i;
    ASSERT_EQ(same.isFirst(i), i < kCrowd || i == 1 + kCrowd) << i;
  }
}

/// The walls of a room of 0.78 units around `middle`, whose corners are rounded there, as a scene in its unit box.
std::vector<Triangle> closedRoom(const glm::vec3& middle) {
  constexpr int kCells = 13;
  std::vector<Triangle> triangles;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-0.37F, 0.41F}) {
      for (int i = 0; i < kCells * kCells; ++i) {
        const auto corner = [&](int x, int y) {
          glm::vec3 p;
          p[axis] = side;
          p[(axis + 1) % 3] = -0.37F + 0.78F * static_cast<float>(i % kCells + x) / kCells;
          p[(axis + 2) % 3] = -0.37F + 0.78F * static_cast<float>(i / kCells + y) / kCells;
          return (middle + p) - middle;
        };
        triangles.push_back({corner(0, 0), corner(1, 0), corner(1, 1)});
        triangles.push_back({corner(0, 0), corner(1, 1), corner(0, 1)});
      }
    }
  }
  return triangles;
}

// What gets out of a closed room between two of its triangles would be lost at each of a thousand bounces.
void expectClosed(const glm::vec3& middle, int rays) {
  const auto triangles = closedRoom(middle);
  const auto scene = sceneOf(triangles);
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-0.35F, 0.35F);
  std::uniform_int_distribution<std::size_t> pick(0, triangles.size() - 1);
  int slipped = 0;
  for (int ray = 0; ray < rays; ray += static_cast<int>(kPacket)) {
    std::array<Ray, kPacket> packet;
    Ways ways{};
    for (std::size_t i = 0; i < kPacket; ++i) {
      auto& r = packet[i];
      r.origin = {uniform(random), uniform(random), uniform(random)};
      // At corners and along edges: where single precision is worst.
      const auto& t = triangles[pick(random)];
      const glm::vec3 to = i % 2 == 0 ? t[0] : t[0] + (0.35F + uniform(random)) * (t[1] - t[0]);
      r.direction = glm::normalize(to - r.origin);
      r.reach = 4.0F;
      for (int axis = 0; axis < 3; ++axis) {
        ways.origin[static_cast<std::size_t>(axis)][i] = r.origin[axis];
        ways.direction[static_cast<std::size_t>(axis)][i] = r.reach * r.direction[axis];
      }
    }
    std::array<Hit, kPacket> hits;
    scene.nearest(packet, hits);
    for (std::size_t i = 0; i < kPacket; ++i) slipped += !hits[i].found() || !scene.nearest(packet[i]).found() ? 1 : 0;
    slipped += scene.open(ways) != 0 ? 1 : 0;
  }
  EXPECT_EQ(slipped, 0);
}

TEST(RayScene, NoRaySlipsOutOfAClosedRoom) { expectClosed(glm::vec3(0.0F), 200'000); }
// Walls that meet there may lie 6e-8 apart.
TEST(RayScene, NoRaySlipsOutOfAClosedRoomWhoseCornersAreRounded) { expectClosed(glm::vec3(1.0F), 200'000); }
// Three minutes.
TEST(RayScene, DISABLED_NoneOfAHundredMillionRaysSlipsOut) { expectClosed(glm::vec3(0.0F), 100'000'000); }

TEST(RayScene, OfNothingAndOfWhatHasNoAreaMeetsNothing) {
  EXPECT_FALSE(RayScene().nearest(Ray{{0, 0, 0}, {0, 0, 1}, 10.0F}).found());
  EXPECT_EQ(RayScene().open(Ways{}), 0xFFU);
  EXPECT_FALSE(sceneOf({}).nearest(Ray{{0, 0, 0}, {0, 0, 1}, 10.0F}).found());
  const Triangle point{glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, 1)};
  const Triangle needle{glm::vec3(-1, 0, 1), glm::vec3(0, 0, 1), glm::vec3(1, 0, 1)};
  EXPECT_FALSE(sceneOf(std::vector{point, needle}).nearest(Ray{{0.1F, 0.2F, 0}, {0, 0, 1}, 10.0F}).found());
}

}  // namespace
}  // namespace radiosity::geometry
