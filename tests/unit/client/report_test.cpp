#include "client/cli/report.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace radiosity::cli {
namespace {

protocol::StatusReply someStatus() {
  protocol::StatusReply status;
  status.progress.state = "converged";
  status.progress.revision = 3;
  status.progress.shots = 1000;
  status.progress.seconds = 1.5;
  status.progress.error = {0.018, 0.001, 0.017, 0.002};
  status.progress.energy = {100.0, 90.0, 5.0, 4.0, 1.5, -0.5};
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
  for (const auto* name : {"total", "residual", "sampling", "discretization"})
    EXPECT_TRUE(report.at("error").at(name).is_number()) << name;
  for (const auto* name : {"emitted", "absorbed", "escaped", "backface", "unshot", "imbalance"})
    EXPECT_TRUE(report.at("energy").at(name).is_number()) << name;
  EXPECT_EQ(report["error"]["total"], 0.018);
  EXPECT_EQ(report["energy"]["imbalance"], -0.5);
  EXPECT_EQ(report["gl_renderer"], "llvmpipe");
  EXPECT_EQ(report["warnings"].size(), 2U);
  EXPECT_EQ(report["counters"]["skippedBlack"], 7.0);
  EXPECT_EQ(report["reached"], true);
  EXPECT_TRUE(report["settings"]["time_limit_s"].is_null());
}

TEST(StatusText, tellsStateErrorAndWarnings) {
  const auto text = statusText(someStatus());
  EXPECT_THAT(text, testing::HasSubstr("state      converged\n"));
  EXPECT_THAT(text, testing::HasSubstr("1.8 % of 2 % (residual 0.1 %, sampling 1.7 %, discretization 0.2 %)"));
  EXPECT_THAT(text, testing::HasSubstr("  3 triangles dropped\n"));
}

}  // namespace
}  // namespace radiosity::cli
