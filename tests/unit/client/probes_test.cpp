#include "client/cli/probes.h"

#include <gmock/gmock.h>

#include "client/cli/scene_file.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

using ::testing::HasSubstr;

TEST(ProbesText, TellsEachGridByNameNodeOrAsTheWholeScene) {
  protocol::ProbeGrid grid;
  grid.counts = {4, 3, 5};
  grid.steps = {{{0.5, 0.0, 0.0}, {0.0, 0.4, 0.0}, {0.0, 0.3, 0.4}}};
  auto numbered = grid, named = grid;
  numbered.node = named.node = 3;
  named.name = "hall";
  const auto text = probesText({1, "converged", 0.02, {grid, numbered, named}}, {60, 57, 0});
  EXPECT_THAT(text, HasSubstr("the whole scene: 4 x 3 x 5 probes, 0.5 x 0.4 x 0.5 m apart\n"));
  EXPECT_THAT(text, HasSubstr("apart; 3 inside solids or behind walls have the light of those beside them\n"));
  EXPECT_THAT(text, HasSubstr("apart; 60 inside solids or behind walls have no light\n"));
  EXPECT_THAT(text, HasSubstr("\nnode 3: 4 x 3 x 5"));
  EXPECT_THAT(text, HasSubstr("\nhall: 4 x 3 x 5"));
}

TEST(ProbeOptions, NeedAFileWithAnEndingThatIsKnown) {
  EXPECT_TRUE(checkProbes({}));
  const auto nowhere = checkProbes({0.5, ""});
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::kBadUsage);
  const auto odd = checkProbes({0.5, "probes.txt"});
  ASSERT_FALSE(odd);
  EXPECT_EQ(odd.error().where, "probes.txt");
}

TEST(ProbeOptions, MayNotReplaceWhatIsReadOrWrittenBesideThem) {
  const TemporaryFolder folder;
  const auto scene = folder.write("scene.gltf", R"({"buffers": [{"uri": "scene%20room.bin"}, {"uri": "data:,"}]})");
  const auto files = externalFiles(scene);
  ASSERT_TRUE(files) << files.error().text();
  EXPECT_EQ(*files, std::vector{folder.file("scene room.bin")});
  EXPECT_FALSE(requireOwnFile({0.5, folder.file("scene room.bin")}, *files));
  EXPECT_FALSE(requireOwnFile({0.5, folder.file("there/../report.json")}, {"", folder.file("report.json")}));
  EXPECT_TRUE(requireOwnFile({0.5, folder.file("probes.bin")}, *files));
}

}  // namespace
}  // namespace radiosity::cli
