// Many hands at one context: the same bits as one, whatever they carry out, and errors that come to whoever asked.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <new>
#include <optional>
#include <random>
#include <stdexcept>
#include <thread>

#include "server/gpu/draw/hemicube_renderer.h"
#include "server/gpu/draw/parallel_renderer.h"
#include "server/gpu/draw/render_desk.h"
#include "server/gpu/workers/gpu_transport.h"
#include "tests/gl/mixed_batch.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

TEST(RenderDesk, WorksInTheThreadThatServesUntilAllHaveLeft) {
  gpu::RenderDesk desk;
  for (int round = 0; round < 3; ++round) {
    constexpr std::size_t kAskers = 4;
    constexpr int kOrders = 200;
    std::vector<std::future<int>> askers;
    std::atomic<int> elsewhere{0};
    int done = 0;  // by the serving thread alone
    const auto server = std::this_thread::get_id();
    for (std::size_t i = 0; i < kAskers; ++i) {
      askers.push_back(std::async(std::launch::async, [&] {
        int seen = 0;
        for (int order = 0; order < kOrders; ++order) {
          desk.ask([&] {
            elsewhere += std::this_thread::get_id() == server ? 0 : 1;
            seen += ++done > 0 ? 1 : 0;
          });
        }
        desk.leave();
        return seen;
      }));
    }
    desk.serve(kAskers);
    for (auto& asker : askers) EXPECT_EQ(asker.get(), kOrders);
    EXPECT_EQ(done, static_cast<int>(kAskers) * kOrders);
    EXPECT_EQ(elsewhere, 0);
  }
}

TEST(RenderDesk, BringsWhatIsThrownToWhoeverAsked) {
  gpu::RenderDesk desk;
  auto asker = std::async(std::launch::async, [&] {
    std::string caught;
    try {
      desk.ask([] { throw std::runtime_error("no memory"); });
    } catch (const std::runtime_error& error) {
      caught = error.what();
    }
    int later = 0;
    desk.ask([&] { later = 1; });
    desk.leave();
    return caught + std::to_string(later);
  });
  desk.serve(1);
  EXPECT_EQ(asker.get(), "no memory1");
}

class Crew : public ::testing::Test {
 protected:
  void SetUp() override {
    if (auto made = gpu::makeInProcessTransport(1); !made) GTEST_SKIP() << made.error().text();
  }

  static std::unique_ptr<solver::Transport> withHands(std::size_t hands,
                                                      const std::shared_ptr<const scene::PatchScene>& scene,
                                                      std::optional<gpu::Drawing> drawing = std::nullopt) {
    auto made = gpu::makeInProcessTransport(hands, drawing).value();
    EXPECT_TRUE(made->setScene(scene).has_value());
    return made;
  }

  /// With lamps of every kind.
  static solver::ShotBatch batchOf(const scene::PatchScene& scene) {
    auto batch = mixedBatch(scene, 30);
    addLamps(batch);
    for (std::uint32_t i = 0; i < 5; ++i) {
      solver::PointShot point;
      point.frame.origin = {0.05F * static_cast<float>(i), 0.1F, 0.2F};
      point.frame.normal = {0, 0, -1};
      point.frame.tangent = {1, 0, 0};
      point.intensity = {3.0, 0.5, 0.1};
      point.emitted = {18.0, 3.0, 0.6};
      point.resolution = 64;
      point.half = i % 2;
      batch.point_lights.push_back(point);
      solver::ParallelShot parallel;
      parallel.irradiance = {1.0, 2.0, 0.5};
      parallel.emitted = {1.0, 2.0, 0.5};
      parallel.first_view = static_cast<std::uint32_t>(batch.views.size());
      parallel.resolution = 64;
      batch.parallel.push_back(parallel);
      batch.views.push_back({{0.0F, 0.6F, 0.8F}, {1.0F, 0.0F, 0.0F}, {0.1F * static_cast<float>(i), 0.5F}});
    }
    return batch;
  }
};

TEST_F(Crew, AnyNumberOfHandsDeliversTheSameBits) {
  const auto scene = randomRoom(120, 4000, 2);
  const auto batch = batchOf(*scene);
  const auto flux_of = [&](solver::Transport& transport) {
    auto flux = accumulators(*scene);
    const auto counters = transport.run(batch, flux);
    EXPECT_TRUE(counters.has_value()) << counters.error().text();
    if (counters) {
      EXPECT_EQ(counters->scatter_shots, batch.scatter.size());
      EXPECT_EQ(counters->gather_shots, batch.gather.size());
      EXPECT_EQ(counters->point_images, batch.point_lights.size() + batch.lamps.size());
      EXPECT_EQ(counters->parallel_images, batch.parallel.size());
    }
    return flux;
  };
  for (const auto drawing : {gpu::Drawing::kByProcessor, gpu::Drawing::kByCard}) {
    const auto expected = flux_of(*withHands(1, scene, drawing));
    EXPECT_NE(expected.scattered, solver::Flux3{});
    EXPECT_NE(expected.gathered, solver::Flux3{});
    for (const std::size_t hands : {2U, 5U}) {
      const auto transport = withHands(hands, scene, drawing);
      for (int again = 0; again < 2; ++again) expectSame(flux_of(*transport), expected);
    }
  }
}

TEST_F(Crew, ManyHandsDoAsThePaperDoes) {
  const auto scene = randomRoom(120, 4000, 2);
  auto batch = mixedBatch(*scene, 30);
  batch.mode = solver::LinkMode::kPaperMipmap;
  auto expected = accumulators(*scene), flux = accumulators(*scene);
  ASSERT_TRUE(withHands(1, scene)->run(batch, expected).has_value());
  EXPECT_NE(expected.scattered, solver::Flux3{});
  ASSERT_TRUE(withHands(4, scene)->run(batch, flux).has_value());
  expectSame(flux, expected);
}

TEST_F(Crew, BeforeAnySceneThereIsAnErrorAndAfterEachTheBitsAreThoseOfThatScene) {
  for (const std::size_t hands : {1U, 4U}) {
    const auto transport = gpu::makeInProcessTransport(hands).value();
    for (const std::uint32_t quads : {0U, 402U, 60U, 120U}) {
      const auto scene = randomRoom(std::max(quads, 60U), 3000, quads);
      const auto batch = mixedBatch(*scene, 20);
      auto flux = accumulators(*scene), expected = accumulators(*scene);
      if (quads == 0) {
        EXPECT_EQ(transport->run(batch, flux).error().code, ErrorCode::kInternal);
        EXPECT_EQ(transport->measure(batch, [](std::size_t, solver::LinkSample&&) {}).error().code,
                  ErrorCode::kInternal);
        continue;
      }
      ASSERT_TRUE(transport->setScene(scene).has_value());
      ASSERT_TRUE(transport->run(batch, flux).has_value());
      ASSERT_TRUE(withHands(1, scene)->run(batch, expected).has_value());
      expectSame(flux, expected);
    }
  }
}

TEST_F(Crew, HasNoMoreHandsThanAGibibyteHolds) {
  const auto scene = randomRoom(60, 1000, 2);
  const auto text = withHands(60, scene)->description();
  const auto at = text.find(", in process, ");
  ASSERT_NE(at, std::string::npos) << text;
  const int hands = std::stoi(text.substr(at + 14));
  EXPECT_GT(hands, 40);  // of 20 MiB each, and a little for this small scene
  EXPECT_LE(hands, 51);
}

TEST_F(Crew, WhatIsThrownWhileLinksAreTakenEndsThatBatchAlone) {
  const auto scene = randomRoom(60, 1000, 2);
  const auto batch = mixedBatch(*scene, 12);
  const auto transport = withHands(3, scene);
  const auto no_room = [](std::size_t shot, solver::LinkSample&&) {
    if (shot == 5) throw std::bad_alloc();
  };
  EXPECT_THROW((void)transport->measure(batch, no_room), std::bad_alloc);
  std::size_t taken = 0;
  EXPECT_TRUE(transport->measure(batch, [&](std::size_t, solver::LinkSample&&) { ++taken; }).has_value());
  EXPECT_EQ(taken, batch.gather.size() + batch.scatter.size());
}

TEST_F(Crew, AnyNumberOfHandsMeasuresTheSameLinksInTheOrderOfTheShots) {
  const auto scene = randomRoom(120, 4000, 2);
  const auto batch = mixedBatch(*scene, 30);
  const auto links_of = [&](std::size_t hands, gpu::Drawing drawing) {
    std::vector<solver::LinkSample> links;
    const auto take = [&](std::size_t shot, solver::LinkSample&& sample) {
      EXPECT_EQ(shot, links.size());
      links.push_back(std::move(sample));
    };
    EXPECT_TRUE(withHands(hands, scene, drawing)->measure(batch, take).has_value());
    return links;
  };
  for (const auto drawing : {gpu::Drawing::kByProcessor, gpu::Drawing::kByCard}) {
    const auto expected = links_of(1, drawing);
    ASSERT_EQ(expected.size(), batch.gather.size() + batch.scatter.size());
    for (const std::size_t hands : {2U, 5U}) {
      const auto found = links_of(hands, drawing);
      ASSERT_EQ(found.size(), expected.size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].irradiance, expected[i].irradiance) << i;
        EXPECT_EQ(found[i].escaped, expected[i].escaped) << i;
        EXPECT_EQ(found[i].absorbed, expected[i].absorbed) << i;
      }
    }
  }
}

TEST_F(Crew, AfterABadShotNothingIsDeliveredAndTheNextBatchIsWhole) {
  const auto scene = randomRoom(60, 1000, 2);
  const auto good = mixedBatch(*scene, 12);
  auto bad = good;
  bad.scatter[7].resolution = 63;
  const auto transport = withHands(3, scene);
  auto flux = accumulators(*scene), expected = accumulators(*scene);
  const auto failed = transport->run(bad, flux);
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().code, ErrorCode::kInternal);
  expectSame(flux, accumulators(*scene));
  ASSERT_TRUE(transport->run(good, flux).has_value());
  ASSERT_TRUE(withHands(1, scene)->run(good, expected).has_value());
  expectSame(flux, expected);
}

TEST_F(Crew, WorkersWithManyHandsGiveTheBitsOfOneProcess) {
  const auto scene = randomRoom(402, 13742, 2);
  const auto batch = mixedBatch(*scene, 60);
  auto expected = accumulators(*scene), flux = accumulators(*scene);
  ASSERT_TRUE(withHands(1, scene)->run(batch, expected).has_value());
  gpu::WorkerOptions options{.workers = 2, .executable = RADIOSITY_GL_WORKER, .hands = 3};
  const auto transport = gpu::makeWorkerTransport(options).value();
  EXPECT_NE(transport->description().find("2 workers of 3 threads"), std::string::npos) << transport->description();
  ASSERT_TRUE(transport->setScene(scene).has_value());
  ASSERT_TRUE(transport->run(batch, flux).has_value());
  expectSame(flux, expected);
}

/// As hemicubes, in triangle_culler_test.cpp.
TEST_F(Crew, ParallelViewsAreThoseThatACardDrawsWithoutChoosing) {
  const auto scene = randomRoom(600, 600, 13);
  const auto context = gpu::EglContext::create().value();
  const auto uploaded = gpu::GpuScene::upload(*context, scene);
  ASSERT_TRUE(uploaded.has_value());
  std::vector<solver::ParallelView> views;
  for (int i = 0; i < 5; ++i) {
    const auto direction = glm::normalize(glm::vec3(0.3F * static_cast<float>(i) - 0.6F, 0.8F, 0.5F));
    const auto right = glm::normalize(glm::cross(direction, glm::vec3(0.0F, 0.0F, 1.0F)));
    views.push_back({direction, right, {0.25F, 0.1F * static_cast<float>(i)}});
  }
  auto by_card = gpu::ParallelRenderer::create(*context, gpu::Drawing::kByCard).value();
  auto by_processor = gpu::ParallelRenderer::create(*context, gpu::Drawing::kByProcessor).value();
  const auto images = [&](gpu::ParallelRenderer& renderer, std::size_t count) {
    EXPECT_GE(renderer.capacity(64), count);
    solver::TransportCounters counters;
    std::vector<std::uint32_t> pixels;
    renderer.render(*uploaded, 64, std::span(views).first(count), counters, pixels);
    EXPECT_EQ(counters.pixels, count * 64 * 64);
    return pixels;
  };
  ASSERT_TRUE(by_card.setScene(*uploaded).has_value());
  ASSERT_TRUE(by_processor.setScene(*uploaded).has_value());
  for (const std::size_t count : {2U, 5U, 1U}) EXPECT_EQ(images(by_card, count), images(by_processor, count)) << count;
}

TEST_F(Crew, ImagesOfACardAreTheSameHoweverManyAreAskedForAtOnceAndAfterOtherScenes) {
  const auto context = gpu::EglContext::create().value();
  auto renderer = gpu::HemicubeRenderer::create(*context, gpu::Drawing::kByCard).value();
  for (const std::uint32_t quads : {300U, 60U}) {
    const auto scene = randomRoom(quads, 600, quads);
    auto uploaded = gpu::GpuScene::upload(*context, scene);
    ASSERT_TRUE(uploaded.has_value());
    ASSERT_TRUE(renderer.setScene(std::move(*uploaded)).has_value());
    std::mt19937 random(3);
    std::vector<gpu::HemicubeView> views;
    for (std::uint32_t i = 0; i < 40; ++i)
      views.push_back({shotFrom(*scene, i % 40, 0.4F, 0.3F, 32, random).frame, 0.5F});
    solver::TransportCounters counters;
    std::vector<std::uint32_t> single, one_by_one, together;
    for (const auto& view : views) {
      renderer.render(gpu::HemicubePass::kItems, 32, std::span(&view, 1), counters, single);
      one_by_one.insert(one_by_one.end(), single.begin(), single.end());
    }
    renderer.render(gpu::HemicubePass::kItems, 32, views, counters, together);
    EXPECT_EQ(together, one_by_one);
  }
}

}  // namespace
}  // namespace radiosity::test
