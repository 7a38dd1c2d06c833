// Single texels: what the engine says of one is what the lightmaps of both quantities hold there.
#include <gmock/gmock.h>

#include <chrono>
#include <future>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::Quantity;
using test_scenes::lumpedCube;

class Texels : public EngineTest {
 protected:
  Result<engine::Texel> texel(std::uint32_t page, std::uint32_t x, std::uint32_t y) {
    return call<engine::Texel>([&](auto done) { engine().texel({page, x, y}, std::move(done)); });
  }
  /// The present lightmaps of a quantity, watched until they are there.
  std::shared_ptr<const engine::Lightmaps> shown(Quantity quantity) {
    const auto watching = engine().watch(quantity);
    std::shared_ptr<const engine::Lightmaps> made;
    EXPECT_TRUE(eventually([&] {
      made = engine().lightmaps(quantity);
      return made != nullptr && made->tile_version == status().tile_version;
    }));
    return made;
  }
  /// Every texel against the pages, and of those that belong to no surface that this is said. Returns how many do.
  std::size_t compareAll() {
    const auto ids = shown(Quantity::kPatchId), light = shown(Quantity::kIrradiance), error = shown(Quantity::kError);
    std::size_t found = 0;
    for (std::uint32_t p = 0; p < ids->pages.size(); ++p) {
      const auto size = ids->pages[p]->size(0);
      for (int y = 0; y < size.y; ++y) {
        for (int x = 0; x < size.x; ++x) {
          const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(size.x) + static_cast<std::size_t>(x);
          const auto read = texel(p, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
          EXPECT_EQ(read.has_value(), ids->pages[p]->id_mips[0].ids[i] != engine::kNoId) << x << ", " << y;
          if (!read) {
            EXPECT_EQ(read.error().code, ErrorCode::kNotFound);
            EXPECT_EQ(read.error().where, "x");
            continue;
          }
          ++found;
          EXPECT_EQ(read->irradiance, light->pages[p]->mips[0].at(x, y));
          EXPECT_EQ(read->error, error->pages[p]->mips[0].at(x, y));
          EXPECT_EQ(read->revision, status().revision);
          EXPECT_EQ(read->tile_version, light->tile_version);
        }
      }
    }
    return found;
  }
};

TEST_F(Texels, HaveWhatThePagesOfBothQuantitiesHave) {
  solve(lumpedCube(0.5));
  EXPECT_EQ(compareAll(), kCubeTexels);
  ASSERT_TRUE(patch(emissionPatch(0, 7.0)));
  ASSERT_TRUE(reaches(State::kConverged));
  const auto revision = status().revision;
  ASSERT_TRUE(eventually([&] { return texel(0, 2, 2)->revision == revision; })) << "what was made before is let go";
  EXPECT_EQ(compareAll(), kCubeTexels);
}

TEST_F(Texels, AreReadThoughNobodyWatches) {
  solve(lumpedCube(0.5));
  const auto watched = *texel(0, 2, 2);
  watching_.reset();
  ASSERT_TRUE(patch(emissionPatch(0, 7.0)));
  ASSERT_TRUE(reaches(State::kConverged));
  ASSERT_TRUE(eventually([&] { return texel(0, 2, 2)->revision == status().revision; }));
  EXPECT_NE(texel(0, 2, 2)->irradiance, watched.irradiance);
  EXPECT_GT(texel(0, 2, 2)->error.x, 0.0F);
}

TEST_F(Texels, SharpenWhileTheSolveGoesOnWithoutAnyVersion) {
  watching_.reset();
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(eventually([&] { return texel(0, 2, 2)->error.x > 0.0F; }));
  const auto first = texel(0, 2, 2)->error.x;
  EXPECT_TRUE(eventually([&] { return texel(0, 2, 2)->error.x < 0.5F * first; }));
}

TEST_F(Texels, ThatAreNotThereAreRefusedByTheNameOfTheMember) {
  EXPECT_EQ(texel(0, 0, 0).error().code, ErrorCode::kNotFound) << "no scene is there";
  solve(lumpedCube(0.5));
  constexpr auto kMost = std::numeric_limits<std::uint32_t>::max();
  const auto size = shown(Quantity::kIrradiance)->pages[0]->size(0);
  const auto pages = static_cast<std::uint32_t>(status().pages);
  const auto where = [&](std::uint32_t page, std::uint32_t x, std::uint32_t y) {
    const auto read = texel(page, x, y);
    EXPECT_FALSE(read);
    return read ? std::string() : read.error().where;
  };
  for (const auto page : {pages, kMost}) EXPECT_EQ(where(page, 2, 2), "page");
  for (const auto x : {static_cast<std::uint32_t>(size.x), kMost}) EXPECT_EQ(where(0, x, 2), "x");
  for (const auto y : {static_cast<std::uint32_t>(size.y), kMost}) EXPECT_EQ(where(0, 2, y), "y");
}

/// An edit of geometry lays pages out anew: what was made for the old ones must not answer for the new. Until pages may
/// be made again, which a drag would have made over and over, nothing does.
TEST_F(Texels, OfAnotherLayoutAreNotThoseOfTheOld) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(texel(0, 2, 2));
  ASSERT_TRUE(configure([](auto& settings) { settings.texels = 600; }));
  const auto revision = status().revision;
  ASSERT_TRUE(eventually([&] {
    const auto read = texel(0, 2, 2);
    EXPECT_EQ(read ? read->revision : revision, revision);
    EXPECT_EQ(read ? ErrorCode::kBusy : read.error().code, ErrorCode::kBusy);
    return read.has_value();
  }));
  ASSERT_TRUE(reaches(State::kConverged));
  ASSERT_TRUE(eventually([&] { return texel(0, 2, 2)->error.x > 0.0F; }));
  EXPECT_GT(compareAll(), kCubeTexels);
}

/// All of them wait for the same pages, however many there are, and none of what must not wait does.
TEST_F(Texels, ThatManyAskForAtOnceAreAllAnswered) {
  solve(lumpedCube(0.5));
  constexpr int kAsked = 200;
  std::vector<std::future<Result<engine::Texel>>> answers;
  for (int i = 0; i < kAsked; ++i) {
    auto promise = std::make_shared<std::promise<Result<engine::Texel>>>();
    answers.push_back(promise->get_future());
    engine().texel({0, 2, 2}, [promise](Result<engine::Texel> read) { promise->set_value(std::move(read)); });
  }
  ASSERT_EQ(answers.back().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  const auto here = texel(0, 2, 2);
  ASSERT_TRUE(here);
  int refused = 0;  // where the queue was full
  for (auto& answer : answers) {
    const auto read = answer.get();
    if (read) {
      EXPECT_EQ(read->irradiance, here->irradiance);
    } else {
      EXPECT_EQ(read.error().code, ErrorCode::kBusy);
      ++refused;
    }
  }
  EXPECT_LT(refused, kAsked / 2);
}

}  // namespace
}  // namespace radiosity::test
