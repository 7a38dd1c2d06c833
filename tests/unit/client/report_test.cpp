#include "client/cli/report.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/one_line.h"

namespace radiosity::cli {
namespace {

protocol::StatusReply someStatus() {
  protocol::StatusReply status;
  status.progress.state = "converged";
  status.progress.revision = 3;
  status.progress.shots = 1000;
  status.progress.seconds = 1.5;
  status.progress.error = {0.018, 0.0175, 0.001, 0.017, 0.003, 0.002};
  status.progress.energy = {100.0, 88.0, 2.0, 5.0, 4.0, 1.5, -0.5};
  status.progress.patches = 14'000;
  status.warnings = {"3 triangles dropped", "bad \xFF byte"};
  status.warning_count = 2;
  status.counters = {{"skippedBlack", 7.0}};
  status.gl_renderer = "llvmpipe";
  return status;
}

TEST(ReportJson, hasEveryMemberThatIsPromised) {
  const auto report = nlohmann::json::parse(reportJson(someStatus(), true));
  for (const auto* name : {"seconds", "shots", "patches", "surfaces", "polygons", "revision"})
    EXPECT_TRUE(report.at(name).is_number()) << name;
  for (const auto* name : {"total", "texels", "residual", "sampling", "variation", "discretization"})
    EXPECT_TRUE(report.at("error").at(name).is_number()) << name;
  for (const auto* name : {"emitted", "absorbed", "specular", "escaped", "backface", "unshot", "imbalance"})
    EXPECT_TRUE(report.at("energy").at(name).is_number()) << name;
  EXPECT_EQ(report["error"]["total"], 0.018);
  EXPECT_EQ(report["energy"]["specular"], 2.0);
  EXPECT_EQ(report["energy"]["imbalance"], -0.5);
  EXPECT_EQ(report["gl_renderer"], "llvmpipe");
  EXPECT_EQ(report["warnings"].size(), 2U);
  EXPECT_EQ(report["counters"]["skippedBlack"], 7.0);
  EXPECT_EQ(report["reached"], true);
  EXPECT_TRUE(report["settings"]["time_limit_s"].is_null());
}

TEST(OutcomeText, saysThatTexelsAreTooLargeOnlyWhereTheyAreWhatLimits) {
  EXPECT_EQ(surfaceText({0.0407, 0.0142, 0.004, 0.0137, 0.001, 0.0381}), "; texels alone are 1.42 % off");
  EXPECT_EQ(surfaceText({0.018, 0.0175, 0.001, 0.017, 0.003, 0.002}), "");
  EXPECT_EQ(surfaceText({0.0637, 0.0142, 0.004, 0.0137, 0.001, 0.0381, 0.202}),
            "; 95 % of places within 20.2 %; texels alone are 1.42 % off");
  EXPECT_EQ(surfaceText({0.02, 0.019, 0.004, 0.0137, 0.001, 0.0381, 0.081}), "; 95 % of places within 8.1 %");
}

TEST(OutcomeText, statesNoErrorWhereNoLightArrives) {
  auto status = someStatus();
  EXPECT_THAT(outcomeText(status.progress), testing::StartsWith("error 1.8 % after 1.5 s"));
  status.progress.unlit = "nothing shines";
  EXPECT_THAT(outcomeText(status.progress), testing::StartsWith("no light arrives: nothing shines; found in 1.5 s"));
  EXPECT_THAT(statusText(status), testing::HasSubstr("error      no light arrives: nothing shines\n"));
  EXPECT_EQ(nlohmann::json::parse(reportJson(status, true))["unlit"], "nothing shines");
  EXPECT_TRUE(nlohmann::json::parse(reportJson(someStatus(), true))["unlit"].is_null());
}

TEST(StatusText, tellsStateErrorAndWarnings) {
  const auto text = statusText(someStatus());
  EXPECT_THAT(text, testing::HasSubstr("state      converged\n"));
  EXPECT_THAT(text,
              testing::HasSubstr(
                  "1.8 % (texels 1.75 % of 2 %: residual 0.1 %, sampling 1.7 %, variation 0.3 %; between them 0.2 %)"));
  auto chosen = someStatus();
  chosen.settings.adaptive = true;
  EXPECT_THAT(statusText(chosen), testing::HasSubstr("1.8 % of 2 % (texels 1.75 %: residual"));
  EXPECT_THAT(text, testing::HasSubstr("  3 triangles dropped\n"));
}

TEST(StatusText, lettersOfPeersDoNotMoveTheCursor) {
  auto status = someStatus();
  status.warnings = {"red \x1b[31m",
                     "window \xc2\x9b"
                     "2J",
                     "bell \a, back\r\n"};
  status.gl_renderer = "\x1b]0;title\x7f";
  const auto text = statusText(status);
  for (const auto* bad : {"\x1b", "\xc2\x9b", "\a", "\r", "\x7f"}) EXPECT_EQ(text.find(bad), std::string::npos);
  EXPECT_THAT(text, testing::HasSubstr("red  [31m\n"));
  EXPECT_EQ(oneLine("\xc3\xa9t\xc3\xa9 \xc2\xa9"), "\xc3\xa9t\xc3\xa9 \xc2\xa9");
}

}  // namespace
}  // namespace radiosity::cli
