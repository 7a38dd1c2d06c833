#include "server/scene/values/glass_face.h"

#include <gtest/gtest.h>

#include <cmath>

namespace radiosity::scene {
namespace {

TEST(GlassFace, WhatIsStoppedAndIsNotReflectedIsWhatWasAbsorbed) {
  const GlassFace face{0.04F};
  constexpr float kEntered = 0.6F;
  const float straight = 1.0F - kEntered * (1.0F - face.reflectance(0.0F));
  for (const float edge : {0.0F, 0.3F, 0.9F}) {
    const float stopped = face.stopped(straight, edge), reflected = face.reflectance(edge);
    EXPECT_NEAR(stopped, 1.0F - kEntered * (1.0F - reflected), 1e-6F);
    EXPECT_NEAR(stopped * face.reflectanceOfStopped(edge, kEntered), reflected, 1e-6F);
  }
}

TEST(GlassFace, StopsInTheMeanWhatTheIntegralOverAnglesSays) {
  const GlassFace face{0.04F};
  constexpr int kSteps = 100'000;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {  // even steps of the square of the cosine
    const double cosine = std::sqrt((i + 0.5) / kSteps);
    sum += 0.04 + 0.96 * std::pow(1.0 - cosine, 5.0);
  }
  EXPECT_NEAR(face.meanStopped(face.reflectance(0.0F)), sum / kSteps, 1e-5);
}

TEST(GlassFace, WhatIsNoGlassStopsTheSameAtEveryAngle) {
  const GlassFace none;
  EXPECT_FALSE(none.isGlass());
  EXPECT_EQ(none.stopped(0.25F, 0.8F), 0.25F);
}

}  // namespace
}  // namespace radiosity::scene
