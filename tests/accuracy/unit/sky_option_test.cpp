// A lightmap that was solved under a sky is compared under the same: the option is read as the solver reads it.
#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/accuracy/solve_run.h"
#include "tests/scenes/scenes.h"

namespace radiosity::accuracy {
namespace {

TEST(SkyOption, IsThatOfTheSolve) {
  LitScene lit;
  setSky("1000/300", lit);
  EXPECT_EQ(lit.scene.sky_upper, glm::dvec3(1000.0));
  EXPECT_EQ(lit.scene.sky_lower, glm::dvec3(300.0));
  LitScene coloured;
  setSky("9,10,12", coloured);
  EXPECT_EQ(coloured.scene.sky_upper, glm::dvec3(9, 10, 12));
  EXPECT_EQ(coloured.scene.sky_lower, glm::dvec3(9, 10, 12));
}

TEST(SkyOption, LightsWhatIsTracedWhereThatIsAnotherFile) {
  LitScene lit;
  lit.unlit.emplace();
  setSky("1000/300", lit);
  EXPECT_EQ(lit.traced().sky_upper, glm::dvec3(1000.0));
  EXPECT_EQ(lit.traced().sky_lower, glm::dvec3(300.0));
}

TEST(SkyOption, YieldsToASkyOfTheScenesOwn) {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  scene.sky_upper_nits = glm::dvec3(80.0);
  LitScene lit{oracle::triangulate(scene), {}};
  setSky("1000", lit);
  EXPECT_EQ(lit.scene.sky_upper, glm::dvec3(80.0));
  EXPECT_EQ(lit.scene.sky_lower, glm::dvec3(0.0));
}

TEST(SkyOption, WhatTheSolveRefusesIsRefused) {
  LitScene lit;
  for (const auto* option : {"-5", "1,2", "1000,300,200,1,1,1", "nan", "1000/", "bright"})
    EXPECT_THROW(setSky(option, lit), std::invalid_argument) << option;
}

}  // namespace
}  // namespace radiosity::accuracy
