#include "common/log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace radiosity {
namespace {

class JsonLog : public ::testing::Test {
 protected:
  void SetUp() override { startLog("tester", "info", LogFormat::kJson); }
  void TearDown() override { startLog("tester", "off"); }

  /// What `write` logs, parsed; each line must be one object.
  static std::vector<nlohmann::json> linesOf(const std::function<void()>& write) {
    ::testing::internal::CaptureStderr();
    write();
    std::istringstream text(::testing::internal::GetCapturedStderr());
    std::vector<nlohmann::json> lines;
    for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }
};

TEST_F(JsonLog, everyLineIsAnObjectWithTimeLevelProgramAndMessage) {
  const auto lines = linesOf([] {
    log::info("first");
    log::warn("second {}", 2);
    log::debug("below the level");
  });
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["level"], "info");
  EXPECT_EQ(lines[0]["program"], "tester");
  EXPECT_EQ(lines[0]["message"], "first");
  EXPECT_EQ(lines[1]["level"], "warning");
  EXPECT_EQ(lines[1]["message"], "second 2");
  EXPECT_FALSE(lines[0].contains("revision"));
  EXPECT_FALSE(lines[0].contains("requestId"));
  const std::regex form(R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z)");
  EXPECT_TRUE(std::regex_match(lines[0]["time"].get<std::string>(), form)) << lines[0]["time"];
}

TEST_F(JsonLog, anyBytesBecomeValidJsonAndUtf8) {
  const std::string good =
      "quote \" backslash \\ line\nbreak tab\t nul" + std::string(1, '\0') + " \xC3\xA9 \xE2\x82\xAC \xF0\x9F\x92\xA1";
  const auto lines = linesOf([&] {
    log::info("{}", good);
    log::info("{}", "cut \xE2\x82 overlong \xC0\xAF surrogate \xED\xA0\x80 high \xF5\x80\x80\x80 alone \x80");
  });
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0]["message"], good);
  const std::string r = "\xEF\xBF\xBD";
  EXPECT_EQ(lines[1]["message"], "cut " + r + r + " overlong " + r + r + " surrogate " + r + r + r + " high " + r + r +
                                     r + r + " alone " + r);
}

TEST(TextLog, aPeersTextCannotBeginALineOfItsOwn) {
  startLog("tester", "info");
  ::testing::internal::CaptureStderr();
  log::info("edit by {}", "mallory\n2026-01-01T00:00:00.000 error [tester] forged \x1b[31m");
  const auto text = ::testing::internal::GetCapturedStderr();
  startLog("tester", "off");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  EXPECT_NE(text.find("mallory\\x0a2026"), std::string::npos) << text;
  EXPECT_NE(text.find(" info [tester] edit by "), std::string::npos) << text;
  EXPECT_EQ(text.find('\x1b'), std::string::npos) << text;
}

TEST(TextLog, anyBytesBecomeUtf8) {
  startLog("tester", "info");
  ::testing::internal::CaptureStderr();
  log::info("{}", "r\xf6ll \xc3\xa9 \xc2\x9b cut \xe2\x82");
  const auto text = ::testing::internal::GetCapturedStderr();
  startLog("tester", "off");
  EXPECT_NE(text.find("r\\xf6ll \xc3\xa9 \\u009b cut \\xe2\\x82\n"), std::string::npos) << text;
}

TEST_F(JsonLog, scopesAddTheirFieldsAndTakeThemAwayAgain) {
  const auto lines = linesOf([] {
    const LogScope outer({.revision = 7, .request_id = "outer"});
    log::info("a");
    {
      const LogScope inner({.revision = 8});
      log::info("b");
    }
    log::info("c");
  });
  ASSERT_EQ(lines.size(), 3U);
  EXPECT_EQ(lines[0]["revision"], 7);
  EXPECT_EQ(lines[0]["requestId"], "outer");
  EXPECT_EQ(lines[1]["revision"], 8);
  EXPECT_EQ(lines[1]["requestId"], "outer");
  EXPECT_EQ(lines[2]["revision"], 7);
}

}  // namespace
}  // namespace radiosity
