// The linear system by itself, on links that no transport measured, against elimination by Gauss in double precision.
#include "server/solver/links/link_system.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/solver/patches/unshot_pyramid.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kLeaves = 8;  // across a wall

class LinkSystems : public testing::Test {
 protected:
  LinkSystems() : made_(test::makeQuadScene(test::cubeQuads(kLeaves, {}, {}))), sides_(makeSides(*made_.patches)) {
    emission_.assign(6 * kLeaves * kLeaves, glm::vec3(0.0F));
    reflectance_.assign(emission_.size(), glm::vec3(0.5F));
  }

  /// Four walls shoot as a whole, two in four parts. Links by chance; each column sums to one.
  [[nodiscard]] LinkSystem makeSystem() const {
    LinkSystem system(*made_.patches, sides_);
    setMaterials(system);
    LinkExpander expander(*made_.patches, sides_);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> uniform(0.1F, 1.0F);
    const auto add = [&](const NodePlace& place) {
      Shooter shooter;
      shooter.place = place;
      const auto index = system.add(shooter);
      const double area = system.shooters()[index].area;
      for (std::size_t half = 0; half < 2; ++half) {
        LinkSample sample;
        double flux = 0.0;
        for (std::uint32_t s = 0; s < sides_.size(); ++s) {
          if (s == place.side) continue;
          for (auto node = sides_[s].first_node; node < sides_[s].first_node + sides_[s].leaf_count; ++node) {
            sample.add(node, uniform(random));
            flux += static_cast<double>(sample.irradiance.back()) * made_.patches->node_area[node];
          }
        }
        sample.scale(area / flux);
        expander.expand(sample);
        system.addSample(index, half, expander, sample, 1.0);
      }
    };
    for (std::uint32_t s = 2; s < 6; ++s) add({s, sides_[s].level_count - 1, 0, 0});
    for (std::uint32_t s = 0; s < 2; ++s) {
      for (std::uint32_t i = 0; i < 4; ++i) add({s, sides_[s].level_count - 2, i % 2, i / 2});
    }
    return system;
  }

  /// Mean radiosities b of red by elimination: b_m - sum over n of K_mn w_n b_n = e_m.
  [[nodiscard]] std::vector<double> eliminate(const LinkSystem& system, std::size_t half) const {
    const auto& shooters = system.shooters();
    const std::size_t n = shooters.size();
    std::vector<std::vector<double>> a(n, std::vector<double>(n + 1, 0.0));
    for (std::size_t m = 0; m < n; ++m) {
      const Side& side = sides_[shooters[m].place.side];
      const auto rect = leafRect(side, shooters[m].place);
      a[m][m] += 1.0;
      for (std::size_t k = 0; k <= n; ++k) {
        std::vector<float> links(side.leaf_count, 0.0F);
        if (k < n) (void)shooters[k].column[half].decode(side.first_value, links);
        double mean = 0.0;
        for (auto y = rect.y0; y < rect.y1; ++y) {
          for (auto x = rect.x0; x < rect.x1; ++x) {
            const auto leaf = y * side.width + x, v = side.first_value + leaf;
            const double area = made_.patches->node_area[side.first_node + leaf];
            const double value =
                k == n ? emission_[v].x : static_cast<double>(links[leaf]) * static_cast<double>(reflectance_[v].x);
            mean += area * value / shooters[m].area;
          }
        }
        if (k == n) {
          a[m][n] = mean;
          continue;
        }
        a[m][k] -= mean * shooters[k].weight[half];
      }
    }
    for (std::size_t i = 0; i < n; ++i) {
      const auto pivot = std::max_element(a.begin() + static_cast<std::ptrdiff_t>(i), a.end(),
                                          [&](auto& p, auto& q) { return std::abs(p[i]) < std::abs(q[i]); });
      std::swap(a[i], *pivot);
      for (std::size_t m = 0; m < n; ++m) {
        if (m == i) continue;
        const double factor = a[m][i] / a[i][i];
        for (std::size_t k = i; k <= n; ++k) a[m][k] -= factor * a[i][k];
      }
    }
    std::vector<double> b;
    for (std::size_t i = 0; i < n; ++i) b.push_back(a[i][n] / a[i][i]);
    return b;
  }

  void setMaterials(LinkSystem& system) const { system.setMaterials(ofNodes(emission_), ofNodes(reflectance_)); }
  /// Nodes above leaves are black: nobody asks for them.
  [[nodiscard]] scene::SideColours ofNodes(const std::vector<glm::vec3>& values) const {
    scene::SideColours colours(*made_.patches);
    for (const auto& side : sides_) {
      std::vector<glm::vec3> of_side(side.node_count, glm::vec3(0.0F));
      std::copy_n(values.begin() + side.first_value, side.leaf_count, of_side.begin());
      colours.assign(side.number, std::move(of_side));
    }
    return colours;
  }
  void paint(float reflectance) { std::fill(reflectance_.begin(), reflectance_.end(), glm::vec3(reflectance)); }
  /// Every leaf another colour.
  void paintAtRandom() {
    std::mt19937 random(9);
    std::uniform_real_distribution<float> uniform(0.0F, 0.9F);
    for (auto& value : reflectance_) value = {uniform(random), uniform(random), uniform(random)};
  }
  void lightWall(std::uint32_t s, const glm::vec3& emission) {
    std::fill_n(emission_.begin() + sides_[s].first_value, sides_[s].leaf_count, emission);
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::vector<glm::vec3> emission_, reflectance_;  // by leaf value
};

TEST_F(LinkSystems, AreSolvedToAMillionthInFewSweepsWhateverTheReflectance) {
  lightWall(3, {2.0F, 1e-9F, 0.0F});
  for (const float rho : {0.0F, 0.5F, 0.9F, 0.999F, 0.9999F}) {
    paint(rho);
    auto system = makeSystem();
    EXPECT_LE(system.solve(), 20) << rho;
    EXPECT_LE(system.unsolved(), 1e-6) << rho;
    for (std::size_t half = 0; half < 2; ++half) {
      const auto exact = eliminate(system, half);
      const double largest = *std::max_element(exact.begin(), exact.end());
      for (std::size_t m = 0; m < exact.size(); ++m) {
        const auto& shooter = system.shooters()[m];
        // What is left unsolved, and entries of the matrix rounded to floats, whose sum is multiplied by 1 / (1 - rho).
        const double allowed = 2e-6 + 1e-8 / (1.0 - static_cast<double>(rho));
        EXPECT_NEAR(shooter.mean[half].x, exact[m], allowed * largest) << rho;
        EXPECT_NEAR(shooter.mean[half].y * 2e9F, exact[m], 2.0 * allowed * largest) << rho;
        EXPECT_EQ(shooter.mean[half].z, 0.0F);
      }
    }
  }
}

TEST_F(LinkSystems, OfManyColoursAreSolvedLeafByLeaf) {
  paintAtRandom();
  lightWall(0, glm::vec3(1.0F));
  auto system = makeSystem();
  system.solve();
  const auto exact = eliminate(system, 1);
  for (std::size_t m = 0; m < exact.size(); ++m) EXPECT_NEAR(system.shooters()[m].mean[1].x, exact[m], 3e-6);
}

TEST_F(LinkSystems, SolvedInTheSmallestSlicesHaveTheSameBits) {
  paint(0.99F);
  lightWall(2, {1.0F, 2.0F, 3.0F});
  auto whole = makeSystem(), sliced = makeSystem();
  whole.solve();
  sliced.begin();
  int slices = 1;
  while (!sliced.advance(0.0)) ++slices;
  EXPECT_GT(slices, 5);
  for (std::size_t m = 0; m < whole.shooters().size(); ++m) {
    EXPECT_EQ(whole.shooters()[m].mean, sliced.shooters()[m].mean);
    EXPECT_EQ(whole.shooters()[m].sent, sliced.shooters()[m].sent);
  }
}

TEST_F(LinkSystems, AfterEditsHaveTheBitsOfFreshOnes) {
  paintAtRandom();
  lightWall(0, glm::vec3(1.0F));
  auto edited = makeSystem();
  edited.solve();
  const auto expectFresh = [&] {
    setMaterials(edited);
    for (auto& shooter : edited.shooters()) shooter.mean = shooter.sent = {};
    edited.solve();
    auto fresh = makeSystem();
    fresh.solve();
    for (std::size_t m = 0; m < fresh.shooters().size(); ++m)
      ASSERT_EQ(edited.shooters()[m].mean, fresh.shooters()[m].mean);
  };
  lightWall(1, glm::vec3(0.25F));  // no entry of the matrix changes
  expectFresh();
  reflectance_[70] = glm::vec3(0.01F);  // some do
  expectFresh();
  paint(0.3F);  // rows of three channels become rows of one
  expectFresh();
  reflectance_[3] = glm::vec3(0.7F);  // and back
  expectFresh();
}

TEST_F(LinkSystems, TakeOverEntriesOfAFormerOneWithTheBitsOfFreshOnes) {
  paintAtRandom();
  std::fill_n(reflectance_.begin() + sides_[2].first_value, sides_[2].leaf_count, glm::vec3(0.4F));
  lightWall(0, glm::vec3(1.0F));
  auto former = makeSystem();
  former.solve();
  reflectance_[sides_[4].first_value + 5] = glm::vec3(0.01F);  // entries of wall 4 hold it
  auto fresh = makeSystem();
  fresh.solve();
  const auto count = static_cast<std::uint32_t>(fresh.shooters().size());
  const auto solved = [&](const LinkSystem::FormerEntries& same) {
    auto heir = makeSystem();
    heir.inheritEntries(former, same);
    heir.solve();
    return heir;
  };
  const auto isFresh = [&](const LinkSystem& heir) {
    for (std::size_t m = 0; m < count; ++m) {
      if (heir.shooters()[m].mean != fresh.shooters()[m].mean) return false;
    }
    return true;
  };
  LinkSystem::FormerEntries same;
  for (std::uint32_t n = 0; n < count; ++n) same.row.push_back(n);
  same.column.fill(same.row);
  EXPECT_TRUE(isFresh(solved(same)));
  auto some = same;
  some.row[1] = some.row[7] = some.column[0][3] = some.column[1][8] = scene::kNone;
  EXPECT_TRUE(isFresh(solved(some)));
  std::swap(some.column[1][2], some.column[1][5]);
  EXPECT_FALSE(isFresh(solved(some))) << "entries are taken from where it is told";
}

TEST_F(LinkSystems, WithoutLightAreDarkAfterOneSweep) {
  auto system = makeSystem();
  EXPECT_EQ(system.solve(), 1);
  for (const auto& shooter : system.shooters()) EXPECT_EQ(shooter.mean[0], glm::vec3(0.0F));
}

TEST_F(LinkSystems, InWhichLightWouldGrowWithoutEndLowerTheirWeights) {
  paint(0.9F);
  lightWall(3, glm::vec3(1.0F));
  auto system = makeSystem();
  for (auto& shooter : system.shooters()) shooter.weight[0] = 1.5;
  system.solve();
  for (const auto& shooter : system.shooters()) {
    EXPECT_LE(shooter.weight[0], 1.0);
    EXPECT_TRUE(std::isfinite(shooter.mean[0].x));
  }
  const auto exact = eliminate(system, 0);
  for (std::size_t m = 0; m < exact.size(); ++m) EXPECT_NEAR(system.shooters()[m].mean[0].x, exact[m], 1e-4);
  EXPECT_EQ(system.shooters()[0].weight[1], 1.0) << "the other half is as it was";
}

}  // namespace
}  // namespace radiosity::solver
