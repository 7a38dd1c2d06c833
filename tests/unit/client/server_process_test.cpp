#include "client/cli/server_process.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <fstream>
#include <thread>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;

/// A shell script in the server's place.
ServerProcess::Options script(const TemporaryFolder& folder, const std::string& body) {
  const auto path = folder.write("radiosityd", "#!/bin/sh\n" + body + "\n");
  chmod(path.c_str(), 0755);
  return {.program = path, .arguments = {}, .keep_going = {}};
}

bool isAlive(pid_t pid) { return kill(pid, 0) == 0; }

TEST(ParseLogLine, splitsTimeLevelNameAndText) {
  const auto line = parseLogLine("2026-01-02T03:04:05.678 warning [radiosityd] room.glb: 3 triangles dropped");
  EXPECT_EQ(line.level, "warning");
  EXPECT_EQ(line.text, "room.glb: 3 triangles dropped");
  EXPECT_TRUE(line.isWarning());
}

TEST(ParseLogLine, takesAnythingElseAsText) {
  for (const auto* text : {"", "x", "no level here", "2026-01-02T03:04:05.678", "terminate called after throwing"}) {
    const auto line = parseLogLine(text);
    EXPECT_EQ(line.level, "");
    EXPECT_EQ(line.text, text);
  }
}

TEST(ServerProcess, knowsTheAddressOnceItListens) {
  const TemporaryFolder folder;
  auto server = ServerProcess::start(script(folder, "echo listening on http://127.0.0.1:4321; exec sleep 60"));
  ASSERT_TRUE(server) << server.error().text();
  EXPECT_EQ(server->url().text(), "http://127.0.0.1:4321");
  EXPECT_TRUE(server->running());
  server->stop(5000ms);
  EXPECT_FALSE(server->running());
}

TEST(ServerProcess, asksForAFreeLoopbackPort) {
  const TemporaryFolder folder;
  auto options = script(folder, "echo \"$@\" > " + folder.file("args") + "; exit 3");
  options.arguments = {"--workers", "2"};
  EXPECT_FALSE(ServerProcess::start(options));
  EXPECT_EQ(folder.read("args"), "--listen 127.0.0.1:0 --token-file /dev/stdin --workers 2\n");
}

TEST(ServerProcess, hasASecretOfItsOwn) {
  const TemporaryFolder folder;
  const auto words =
      "read t; echo $t >> " + folder.file("token") + "; echo listening on http://127.0.0.1:4321; exec sleep 60";
  std::string said;
  for (int i = 0; i < 2; ++i) {
    auto server = ServerProcess::start(script(folder, words));
    ASSERT_TRUE(server) << server.error().text();
    EXPECT_EQ(server->token().size(), 64U);
    EXPECT_EQ(said.find(server->token()), std::string::npos);
    said += server->token() + "\n";
  }
  EXPECT_EQ(folder.read("token"), said);
}

TEST(ServerProcess, asksForNoSecretWhereOthersAreToJoin) {
  const TemporaryFolder folder;
  auto options = script(folder, "echo \"$@\" > " + folder.file("args") + "; exit 3");
  options.secret = false;
  EXPECT_FALSE(ServerProcess::start(options));
  EXPECT_EQ(folder.read("args"), "--listen 127.0.0.1:0\n");
}

TEST(ServerProcess, handsOverWhyItDidNotStart) {
  const TemporaryFolder folder;
  const auto no_driver = ServerProcess::start(
      script(folder, "echo '2026-01-02T03:04:05.678 error [radiosityd] no EGL driver' >&2; echo bye >&2; exit 1"));
  ASSERT_FALSE(no_driver);
  EXPECT_EQ(no_driver.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(no_driver.error().text(), "radiosityd: no EGL driver");

  const auto bad_scene =
      ServerProcess::start(script(folder, "echo 'radiosityd: room.gltf: /buffers/0: cut off' >&2; exit 2"));
  ASSERT_FALSE(bad_scene);
  EXPECT_EQ(bad_scene.error().code, ErrorCode::kBadInput);
  EXPECT_EQ(bad_scene.error().text(), "radiosityd: room.gltf: /buffers/0: cut off");

  const auto crashed = ServerProcess::start(script(folder, "kill -SEGV $$"));
  ASSERT_FALSE(crashed);
  EXPECT_NE(crashed.error().text().find("signal"), std::string::npos);
}

TEST(ServerProcess, startIsAbandonedAtOnceWhenAsked) {
  const TemporaryFolder folder;
  auto options = script(folder, "exec sleep 60");
  options.keep_going = [] { return false; };
  EXPECT_FALSE(ServerProcess::start(options));
}

TEST(ServerProcess, stopEndsWorkersThatAreLeft) {
  const TemporaryFolder folder;
  auto server =
      ServerProcess::start(script(folder, "sleep 60 & echo $! > " + folder.file("worker") +
                                              "; trap '' TERM\n"
                                              "echo listening on http://127.0.0.1:1; while :; do sleep 0.05; done"));
  ASSERT_TRUE(server) << server.error().text();
  const pid_t worker = std::stoi(folder.read("worker"));
  EXPECT_TRUE(isAlive(worker));
  server->stop(100ms);
  for (int i = 0; i < 500 && isAlive(worker); ++i) {
    // an orphan is reaped by init, in its own time; a zombie is as good as gone
    std::ifstream stat("/proc/" + std::to_string(worker) + "/stat");
    const std::string text(std::istreambuf_iterator<char>(stat), {});
    if (text.find(") Z") != std::string::npos) return;
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_FALSE(isAlive(worker));
}

TEST(ServerProcess, passesLogLinesOnInOrder) {
  const TemporaryFolder folder;
  auto server =
      ServerProcess::start(script(folder,
                                  "echo one >&2; echo '2026-01-02T03:04:05.678 warning [radiosityd] two' >&2\n"
                                  "echo listening on http://127.0.0.1:1; exec sleep 60"));
  ASSERT_TRUE(server);
  std::vector<LogLine> lines;
  while (lines.size() < 2)
    for (auto& line : server->takeLog()) lines.push_back(line);
  EXPECT_EQ(lines[0].text, "one");
  EXPECT_EQ(lines[1].text, "two");
  EXPECT_TRUE(lines[1].isWarning());
}

}  // namespace
}  // namespace radiosity::cli
