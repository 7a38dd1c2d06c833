#include "server/solver/math/halves.h"

#include <gtest/gtest.h>

#include <array>
#include <new>
#include <stdexcept>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

TEST(BothHalves, AreWorkedOnOnceEach) {
  std::array<int, 2> times{};
  inBothHalves([&](std::size_t half) { ++times[half]; });
  EXPECT_EQ(times, (std::array<int, 2>{1, 1}));
}

TEST(BothHalves, HandOnWhatEitherThrowsAfterBothHaveEnded) {
  for (const std::size_t failing : {0U, 1U}) {
    std::array<bool, 2> ended{};
    const auto work = [&](std::size_t half) {
      if (half == failing) throw std::bad_alloc();
      ended[half] = true;
    };
    EXPECT_THROW(inBothHalves(work), std::bad_alloc);
    EXPECT_TRUE(ended[1 - failing] || failing == 0);
  }
}

/// Has no memory left for what it measured.
class FullTransport final : public Transport {
 public:
  Result<void> setScene(std::shared_ptr<const scene::PatchScene>) override { return {}; }
  Result<TransportCounters> run(const ShotBatch&, FluxAccumulators&) override { throw std::bad_alloc(); }
  [[nodiscard]] std::string description() const override { return "full"; }

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches; }

 public:
  std::shared_ptr<const scene::PatchScene> patches;
};

TEST(OutOfMemory, IsAnErrorOfTheStepThatSaysWhatToDo) {
  const auto made = test::makeQuadScene(test::cubeQuads(4, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  FullTransport full;
  full.patches = made.patches;
  LinkedSolver solver(made.patches, made.materials, full, SolverSettings{});
  const auto outcome = solver.step();
  ASSERT_FALSE(outcome.has_value());
  EXPECT_EQ(outcome.error().code, ErrorCode::kTooLarge);
  EXPECT_NE(outcome.error().message.find("fewer texels"), std::string::npos) << outcome.error().message;
}

}  // namespace
}  // namespace radiosity::solver
