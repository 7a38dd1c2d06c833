// Receivers whose plane cuts off part of a light, close to what it leaves: a wall's foot and a floor or a lamp that
// reaches out from under the wall. They receive what they see of it, no more, however few points the light has.
#include <algorithm>
#include <array>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <optional>
#include <span>

#include "server/solver/math/polygon_form_factor.h"
#include "tests/gl/gather_fixture.h"

namespace radiosity::test {
namespace {

/// A way from a receiver to a light is free.
using Seen = std::function<bool(const glm::dvec3& from, const glm::dvec3& to)>;

/// Form factor of what of z = 0, x0 < x < x1, |y| < 0.3 is seen from `at`, whose normal is -x: by a grid that is finer
/// towards the wall, x = 0.
double seenFormFactor(const glm::dvec3& at, double x0, double x1, const Seen& seen) {
  constexpr int kAcross = 1000, kAlong = 600;
  double sum = 0.0;
  for (int i = 0; i < kAcross; ++i) {
    const double k = (i + 0.5) / kAcross, x = x1 + (x0 - x1) * k * k, width = (x1 - x0) * 2.0 * k / kAcross;
    for (int j = 0; j < kAlong; ++j) {
      const glm::dvec3 to(x, -0.3 + 0.6 * (j + 0.5) / kAlong, 0.0);
      const auto way = to - at;
      const double square = glm::dot(way, way);
      if (way.x < 0.0 && seen(at, to)) sum += width * way.x * way.z / (square * square);
    }
  }
  return sum * 0.6 / (kAlong * std::numbers::pi);
}

class GatherBeside : public Gather {
 protected:
  struct Room {
    float wall_z, wall_height;
    std::uint32_t wall_rows;
    float light_x, light_width;  ///< z = 0
    std::optional<Quad> cover = {};
    std::uint32_t light_columns = 1;
  };

  void build(const Room& room) {
    SceneBuilder builder;
    rows_ = room.wall_rows;
    wall_ = builder.add({{0, -0.3F, room.wall_z}, {0, 0, room.wall_height}, {0, 0.6F, 0}, rows_, 12});  // faces -x
    light_ = builder.add({{room.light_x, -0.3F, 0}, {room.light_width, 0, 0}, {0, 0.6F, 0}, room.light_columns, 1});
    if (room.cover) cover_ = builder.add(*room.cover);
    scene_ = builder.build();
  }

  [[nodiscard]] glm::dvec3 middleOf(std::uint32_t x, std::uint32_t y) const {
    const auto& frame = scene_->triangles[scene_->surfaces[wall_].first_triangle];
    return frame.origin + (static_cast<float>(x) + 0.5F) * frame.du + (static_cast<float>(y) + 0.5F) * frame.dv;
  }

  /// Irradiance of the middle of the wall's lowest leaves, the mean over its length but the ends, of `shots` shots of
  /// points_a_side^2 points. Each receives at its middle.
  double received(int shots, std::uint32_t points_a_side) {
    std::mt19937 random(5);
    double sum = 0.0;
    for (int i = 0; i < shots; ++i) {
      auto batch = gatherFrom(*scene_, light_, points_a_side, random);
      batch.gather[0].receiver_jitter = {0.5F, 0.5F};
      const auto flux = run(scene_, batch);
      for (std::uint32_t y = 2; y < 10; ++y) sum += irradiance(*scene_, flux, wall_, 0, y) / (8.0 * shots);
    }
    return sum;
  }

  /// The same by quadrature.
  double expected(const Room& room, const Seen& seen) const {
    double sum = 0.0;
    for (std::uint32_t y = 2; y < 10; ++y)
      sum += seenFormFactor(middleOf(0, y), room.light_x, room.light_x + room.light_width, seen) / 8.0;
    return sum;
  }

  std::shared_ptr<const scene::PatchScene> scene_;
  std::uint32_t wall_ = 0, light_ = 0, cover_ = 0, rows_ = 0;
};

/// A floor of which a twentieth lies before the wall's plane.
constexpr float kFloorX = -0.02F, kFloorWidth = 0.4F;

/// Upright, parallel to the wall, standing on the light.
Quad board(float x) { return {{x, -0.5F, 0.0F}, {0, 1, 0}, {0, 0, 0.5F}, 1, 1}; }

TEST_P(GatherBeside, OnePointTellsWhereverItLies) {
  const Room room{0.001F, 0.1F, 2, kFloorX, kFloorWidth};
  build(room);
  std::mt19937 random(5);
  double all = 0.0;
  for (int i = 0; i < 20; ++i) {
    auto batch = gatherFrom(*scene_, light_, 1, random);
    batch.gather[0].receiver_jitter = {0.5F, 0.5F};
    const auto flux = run(scene_, batch);
    const auto corners = std::span(batch.gather[0].corners).first(batch.gather[0].corner_count);
    for (std::uint32_t y = 0; y < 12; ++y) {
      const auto exact = solver::polygonFormFactor(middleOf(0, y), {-1, 0, 0}, corners);
      EXPECT_NEAR(irradiance(*scene_, flux, wall_, 0, y), exact, 1e-3 * exact) << i << ", " << y;
      all += exact;
    }
  }
  EXPECT_GT(all, 1.0);
}

// 1,600 rays of which one in sixteen or nine in twenty arrive: standard error 0.6 % and 1.3 % of the form factor.
TEST_P(GatherBeside, OnePointLooksPastASkirtingBoard) {
  for (const auto& [x, tolerance] : {std::pair{-0.004F, 0.02}, {-0.012F, 0.04}}) {
    Room room{0.001F, 0.1F, 2, kFloorX, kFloorWidth};
    build(room);
    const auto open = expected(room, [](const auto&, const auto&) { return true; });
    room.cover = board(x);
    build(room);
    const auto seen = expected(room, [x = x](const auto&, const auto& to) { return to.x > x; });
    EXPECT_GT(seen, 0.02 * open);
    EXPECT_LT(seen, 0.9 * open);
    EXPECT_NEAR(received(200, 1) / open, seen / open, tolerance) << x;
  }
}

// A lamp of 256 points, of which a twentieth lies behind the wall's plane. Those next to the wall would tell of all.
// The standard error of 4 * 8 * 256 rays of which one in twelve or nine in ten arrive is 4 % and 0.4 % of what arrives.
TEST_P(GatherBeside, ManyPointsTellHowMuchIsSeen) {
  Room room{0.0F, 0.02F, 1, -0.38F, 0.4F, board(-0.04F)};
  build(room);
  const auto past_board = expected(room, [](const auto&, const auto& to) { return to.x > -0.04; });
  EXPECT_NEAR(received(4, 16) / past_board, 1.0, 0.03) << "a board across, on the lamp";

  room.cover = Quad{{-0.06F, -0.5F, 0.004F}, {0.06F, 0, 0}, {0, 1, 0}, 1, 1};
  build(room);
  const auto past_plate = expected(room, [](const auto& from, const auto& to) {
    const double t = (0.004 - from.z) / (to.z - from.z);
    return from.x + t * (to.x - from.x) < -0.06;
  });
  EXPECT_NEAR(received(4, 16) / past_plate, 1.0, 0.12) << "a plate over its edge";
}

/// A floor of whose leaves on the wall's side of x = 0, where the wall sees them, only `fill` is there. All of the
/// light that is gathered from it has its points elsewhere.
class GatherBesideHoles : public GatherBeside {
 protected:
  void makeHoles(const Room& room, std::uint32_t columns_seen, float fill) {
    build(room);
    auto made = std::make_shared<scene::PatchScene>(*scene_);
    const auto& surface = made->surfaces[light_];
    for (std::uint32_t x = 0; x < columns_seen; ++x) {
      made->node_area[surface.first_node[0] + x] *= fill;
      if (fill == 0.0F) made->leaves[surface.first_leaf + x].triangle = scene::kNone;
    }
    scene_ = made;
  }

  /// The form factor of the floor from the wall, whatever is missing of it, and how much of that arrives.
  double arrives(int shots, float fill) {
    std::mt19937 random(5);
    double sum = 0.0, all = 0.0;
    for (int i = 0; i < shots; ++i) {
      auto batch = gatherFrom(*scene_, light_, 2, random);
      for (auto& point : batch.points) point.origin.x = std::abs(point.origin.x) + 0.01F;
      auto& shot = batch.gather[0];
      shot.receiver_jitter = {0.5F, 0.5F};
      shot.fill = fill;
      shot.triangle = scene_->surfaces[light_].first_triangle;
      const auto flux = run(scene_, batch);
      const auto corners = std::span(shot.corners).first(shot.corner_count);
      for (std::uint32_t y = 0; y < 12; ++y) {
        sum += irradiance(*scene_, flux, wall_, 0, y);
        all += solver::polygonFormFactor(middleOf(0, y), {-1, 0, 0}, corners);
      }
    }
    EXPECT_GT(all, 0.1 * 12 * shots);
    return sum / all;
  }
};

TEST_P(GatherBesideHoles, AHoleInAFloorShinesAtNothing) {
  makeHoles({0.001F, 0.1F, 2, -0.2F, 0.5F, {}, 5}, 2, 0.0F);
  EXPECT_EQ(arrives(10, 0.6F), 0.0);
}

// 20 * 4 * 12 rays of which half find the floor: standard error 1.6 %.
TEST_P(GatherBesideHoles, LeavesThatAreThereByHalfShineByHalf) {
  makeHoles({0.001F, 0.1F, 2, -0.2F, 0.5F, {}, 5}, 2, 0.5F);
  EXPECT_NEAR(arrives(20, 0.8F), 0.5, 0.05);
}

TEST_P(GatherBesideHoles, OfALeafThatAWallStandsOnTheWallSeesWhatIsLeft) {
  makeHoles({0.001F, 0.1F, 2, kFloorX, kFloorWidth}, 1, 0.05F);
  EXPECT_NEAR(arrives(10, 0.05F), 1.0, 1e-3);
}

// A closed block stands on the farther half of the leaf before the wall. The standard error of 40 * 12 * 4 rays of
// which two in three arrive is 2 %.
TEST_P(GatherBesideHoles, WhatASolidHidesOfALeafIsMissedOnce) {
  const Room room{0.001F, 0.1F, 2, -0.2F, 0.5F, board(-0.05F), 5};
  makeHoles(room, 2, 0.5F);
  auto made = std::make_shared<scene::PatchScene>(*scene_);
  const auto& surface = made->surfaces[light_];
  auto& leaf = made->leaves[surface.first_leaf + 1];
  leaf.full = false;
  std::vector<scene::LeafSpots::Place> places;
  for (std::uint16_t i = 0; i < 64; ++i) places.push_back({i, leaf.triangle});
  scene::LeafSpots::order(64, places);
  leaf.spot_list = made->spots.add({{1.5F, 0.0F}, {0.5F, 1.0F}, 64}, places, true);
  scene_ = made;
  double open = 0.0, seen = 0.0;
  for (std::uint32_t y = 0; y < 12; ++y) {
    const auto at = middleOf(0, y);
    open += seenFormFactor(at, -0.2, 0.0, [](const auto&, const auto&) { return true; });
    seen += seenFormFactor(at, -0.2, 0.0, [](const auto&, const auto& to) { return to.x > -0.05; });
  }
  EXPECT_GT(seen, 0.3 * open);
  EXPECT_NEAR(arrives(40, 0.8F), seen / open, 0.05);
}

TEST_P(GatherBeside, WhatIsMaskedHidesAsWhatIsOpaque) {
  const Room room{0.001F, 0.1F, 2, kFloorX, kFloorWidth, board(-0.002F)};
  build(room);
  const auto past = expected(room, [](const auto&, const auto& to) { return to.x > -0.002; });
  auto masked = std::make_shared<scene::PatchScene>(*scene_);
  masked->surfaces[cover_].see_through = true;
  masked->surfaces[cover_].first_opacity = 0;
  masked->opacity = {255};  // no hole in it
  scene_ = masked;
  // One point of 200 in the strip that is seen; each counts for its share of the floor.
  EXPECT_NEAR(received(400, 1), past, 0.01);
}

INSTANTIATE_TEST_SUITE_P(Sight, GatherBeside, kBothSights, nameOfSight);
INSTANTIATE_TEST_SUITE_P(Sight, GatherBesideHoles, kBothSights, nameOfSight);

}  // namespace
}  // namespace radiosity::test
