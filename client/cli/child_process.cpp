#include "client/cli/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <utility>

#include "client/cli/interrupt.h"

namespace radiosity::cli {
namespace {

constexpr std::size_t kMostText = 4096;
constexpr std::chrono::minutes kMostTime{10};

/// Runs in the child, between fork and exec: only async-signal-safe calls.
[[noreturn]] void become(const std::vector<char*>& arguments, int errors) {
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) signal(number, SIG_DFL);
  dup2(errors, STDERR_FILENO);
  dup2(errors, STDOUT_FILENO);
  execvp(arguments[0], arguments.data());
  _exit(kNoProgram);
}

/// What the child printed last, once it has ended. Errors: a signal has come, or it takes too long; the child is there
/// still.
Result<std::string> readAll(int from) {
  std::string text;
  std::array<char, 1024> part{};
  const auto end = std::chrono::steady_clock::now() + kMostTime;
  for (;;) {
    if (interrupted()) return fail(ErrorCode::kCancelled, "interrupted");
    if (std::chrono::steady_clock::now() > end)
      return fail(ErrorCode::kUnavailable, "the program does not come to an end");
    constexpr int kTickMs = 50;
    pollfd wait{from, POLLIN, 0};
    if (poll(&wait, 1, kTickMs) <= 0) continue;
    const auto count = read(from, part.data(), part.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return text;
    text.append(part.data(), static_cast<std::size_t>(count));
    if (text.size() > kMostText) text.erase(0, text.size() - kMostText);
  }
}

}  // namespace

Result<Ran> runProgram(std::vector<std::string> command) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return fail(ErrorCode::kUnavailable, std::string("pipe: ") + strerror(errno));
  std::vector<char*> arguments;
  for (auto& word : command) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) become(arguments, ends[1]);
  close(ends[1]);
  if (child < 0) {
    close(ends[0]);
    return fail(ErrorCode::kUnavailable, std::string("fork: ") + strerror(errno));
  }
  auto text = readAll(ends[0]);
  close(ends[0]);
  if (!text) kill(child, SIGKILL);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
  if (!text) return tl::unexpected(text.error());
  Ran ran{WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), std::move(*text)};
  while (!ran.text.empty() && ran.text.back() == '\n') ran.text.pop_back();
  return ran;
}

}  // namespace radiosity::cli
