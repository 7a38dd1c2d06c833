#include "client/cli/child_process.h"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

TEST(ChildProcess, tellsWhatAProgramPrintedAndHowItEnded) {
  const auto ran = runProgram({"sh", "-c", "echo one; echo two >&2; exit 127"});
  ASSERT_TRUE(ran) << ran.error().text();
  EXPECT_EQ(ran->exit_code, 127);
  EXPECT_EQ(ran->text, "one\ntwo");
  const auto killed = runProgram({"sh", "-c", "kill -TERM $$"});
  ASSERT_TRUE(killed);
  EXPECT_EQ(killed->exit_code, 128 + SIGTERM);
}

TEST(ChildProcess, keepsTheEndOfALongText) {
  const auto ran = runProgram({"sh", "-c", "yes | head -c 100000; echo end"});
  ASSERT_TRUE(ran);
  EXPECT_LE(ran->text.size(), 4096U);
  EXPECT_TRUE(ran->text.ends_with("end"));
}

TEST(ChildProcess, namesAProgramThatIsNotThereOrMayNotRun) {
  const auto missing = runProgram({"no-such-program"});
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(missing.error().where, "no-such-program");
  const TemporaryFolder folder;
  const auto path = folder.write("plain", "text");
  const auto refused = runProgram({path});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(refused.error().message.find("Permission denied"), std::string::npos);
}

TEST(ChildProcess, waitsForNoneThatOutlivesTheProgram) {
  const auto start = std::chrono::steady_clock::now();
  const auto ran = runProgram({"sh", "-c", "sleep 30 & echo done"});
  ASSERT_TRUE(ran);
  EXPECT_EQ(ran->text, "done");
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

TEST(ChildProcess, givesItNothingToRead) {
  const auto ran = runProgram({"cat"});
  ASSERT_TRUE(ran);
  EXPECT_EQ(ran->exit_code, 0);
  EXPECT_EQ(ran->text, "");
}

}  // namespace
}  // namespace radiosity::cli
