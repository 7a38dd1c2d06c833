// Settings that outlive the process, beside those of the next one's command line.
#include "server/engine/persist/kept_settings.h"

#include <gtest/gtest.h>

namespace radiosity::engine {
namespace {

SolveSettings chosen() {
  SolveSettings settings;
  settings.adaptive = true;
  settings.texels = kMostTexels;
  return settings;
}

TEST(KeptSettings, GoBeforeWhatTheCommandLineDoesNotName) {
  auto kept = chosen();
  kept.target_error = 0.005;
  kept.texels = 123;
  const auto now = withKept({}, keptSettings(kept), {});
  EXPECT_EQ(now.target_error, 0.005);
  EXPECT_EQ(now.texels, 123U);
  EXPECT_TRUE(now.adaptive);
  EXPECT_EQ(withKept({}, keptSettings(kept), {"texels"}).texels, kTexels);
}

// A folder that is new has none; one of an older version had texels of one size.
TEST(KeptSettings, OfANewFolderTakeNothingFromThoseThatThereAre) {
  auto wanted = chosen();
  wanted.double_sided = true;
  EXPECT_EQ(withKept(wanted, {}, {}), wanted);
  auto old = keptSettings(chosen());
  old.erase("adaptive");
  EXPECT_FALSE(withKept(chosen(), old, {}).adaptive);
}

// The most that the program may choose were kept, not a million of one size.
TEST(KeptSettings, AsManyTexelsAsUsualAreAsManyAsAreUsualNow) {
  SolveSettings uniform;
  EXPECT_EQ(withKept(uniform, keptSettings(chosen()), {"adaptive"}).texels, kTexels);
  auto paper = chosen();
  paper.method = Method::kPaper;
  EXPECT_EQ(withKept(paper, keptSettings(chosen()), {"method"}).texels, kTexels);
  EXPECT_EQ(withKept(chosen(), keptSettings(uniform), {"adaptive"}).texels, kMostTexels);
  auto many = uniform;
  many.texels = kMostTexels;  // of one size: somebody wanted so many
  EXPECT_EQ(withKept(uniform, keptSettings(many), {}).texels, kMostTexels);
}

}  // namespace
}  // namespace radiosity::engine
