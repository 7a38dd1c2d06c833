#include "protocol/sky.h"

#include <gtest/gtest.h>

#include "protocol/codec.h"

namespace radiosity::protocol {
namespace {

TEST(Sky, OneNumberIsAGreySkyAllAround) {
  const auto sky = parseSky("1000");
  ASSERT_TRUE(sky);
  EXPECT_EQ(sky->upper, (std::array{1000.0, 1000.0, 1000.0}));
  EXPECT_EQ(sky->lower, sky->upper);
}

TEST(Sky, TwoColoursAreAboveAndBelowTheHorizon) {
  const auto sky = parseSky("1,2.5,3/0.1,0,1e3");
  ASSERT_TRUE(sky);
  EXPECT_EQ(sky->upper, (std::array{1.0, 2.5, 3.0}));
  EXPECT_EQ(sky->lower, (std::array{0.1, 0.0, 1000.0}));
}

TEST(Sky, AnythingElseIsBadUsageAndSaysWhatIsMeant) {
  for (const char* text :
       {"", "/", "1,2", "1,2,3,4", "-1", "nan", "inf", "1e13", "1/", "1/2/3", "a", "1, 2,3", "1,2,"}) {
    const auto sky = parseSky(text);
    ASSERT_FALSE(sky) << text;
    EXPECT_EQ(sky.error().code, ErrorCode::kBadUsage);
    EXPECT_NE(sky.error().text().find("R,G,B"), std::string::npos) << sky.error().text();
  }
}

}  // namespace
}  // namespace radiosity::protocol
