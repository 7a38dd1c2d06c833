#include "client/cli/server_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/random.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>
#include <utility>

#include "common/check.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr auto kStartTimeout = 60s;  // a cold driver compiles shaders
constexpr std::string_view kListening = "listening on ";
constexpr std::size_t kMaxLineBytes = 4096;
constexpr std::size_t kMaxLogLines = 1000;
constexpr int kExecFailed = 127;

struct Pipe {
  int read_end = -1, write_end = -1;
};

Result<Pipe> makePipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return fail(ErrorCode::kUnavailable, std::string("pipe: ") + strerror(errno));
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return Pipe{ends[0], ends[1]};
}

/// A secret of 256 bits, as hexadecimal digits.
Result<std::string> makeToken() {
  std::array<std::uint8_t, 32> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    return fail(ErrorCode::kUnavailable, std::string("getrandom: ") + strerror(errno));
  std::string token;
  for (const auto byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

/// A pipe from which the token can be read, once: its reading end, which blocks.
Result<int> tokenPipe(const std::string& token) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) return fail(ErrorCode::kUnavailable, std::string("pipe: ") + strerror(errno));
  const bool written = write(ends[1], token.data(), token.size()) == static_cast<ssize_t>(token.size());
  close(ends[1]);
  if (written) return ends[0];
  close(ends[0]);
  return fail(ErrorCode::kUnavailable, std::string("pipe: ") + strerror(errno));
}

/// Runs in the child, between fork and exec: only async-signal-safe calls.
[[noreturn]] void becomeServer(const std::vector<char*>& arguments, int secret, int out, int err, pid_t parent) {
  // A group of its own: Ctrl-C in the terminal reaches only us, and we decide how it ends.
  setpgid(0, 0);
  // It must not outlive us, however we end.
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(kExecFailed);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) signal(number, SIG_DFL);
  dup2(secret, STDIN_FILENO);
  dup2(out, STDOUT_FILENO);
  dup2(err, STDERR_FILENO);
  execv(arguments[0], arguments.data());
  constexpr std::string_view kWhy = "cannot be executed\n";
  (void)!write(STDERR_FILENO, kWhy.data(), kWhy.size());
  _exit(kExecFailed);
}

/// Appends what can be read without waiting; false at the end of the stream.
bool drain(int descriptor, std::string& text) {
  std::array<char, 4096> chunk{};
  for (;;) {
    const ssize_t count = read(descriptor, chunk.data(), chunk.size());
    if (count > 0) {
      text.append(chunk.data(), static_cast<std::size_t>(count));
    } else if (count == 0) {
      return false;
    } else if (errno != EINTR) {
      return errno == EAGAIN;
    }
  }
}

std::optional<std::string> takeLine(std::string& text) {
  const auto end = text.find('\n');
  if (end == std::string::npos) {
    if (text.size() < kMaxLineBytes) return std::nullopt;
    return std::exchange(text, {});
  }
  std::string line = text.substr(0, end);
  text.erase(0, end + 1);
  return line;
}

}  // namespace

LogLine parseLogLine(const std::string& line) {
  const auto first = line.find(' ');
  const auto second = first == std::string::npos ? first : line.find(' ', first + 1);
  const bool has_time = first != std::string::npos && first >= 19 && line[4] == '-' && line[10] == 'T';
  if (!has_time || second == std::string::npos) return {"", line};
  std::string text = line.substr(second + 1);
  if (text.starts_with('[')) {
    const auto end = text.find("] ");
    if (end != std::string::npos) text.erase(0, end + 2);
  }
  return {line.substr(first + 1, second - first - 1), text};
}

Result<std::string> findServerProgram() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  std::vector<fs::path> places;
  if (!error) {
    const fs::path folder = self.parent_path();
    places = {folder / "radiosityd", folder / "../server/radiosityd", folder / "../../server/radiosityd"};
  }
  if (const char* path = std::getenv("PATH"); path != nullptr) {
    std::string_view rest(path);
    while (!rest.empty()) {
      const auto end = std::min(rest.find(':'), rest.size());
      if (end > 0) places.emplace_back(fs::path(rest.substr(0, end)) / "radiosityd");
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  for (const auto& place : places)
    if (fs::is_regular_file(place, error) && access(place.c_str(), X_OK) == 0)
      return fs::weakly_canonical(place, error).string();
  return fail(ErrorCode::kUnavailable, "radiosityd was not found beside " + self.string() +
                                           " nor in PATH; install it, or name a running one with "
                                           "--server");
}

Result<ServerProcess> ServerProcess::start(const Options& options) {
  std::vector<std::string> words = {options.program, "--listen", "127.0.0.1:0"};
  if (options.secret) words.insert(words.end(), {"--token-file", "/dev/stdin"});
  words.insert(words.end(), options.arguments.begin(), options.arguments.end());
  std::vector<char*> arguments;
  for (auto& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  auto out = makePipe();
  auto err = out ? makePipe() : out;
  if (!err) return tl::unexpected(err.error());
  ServerProcess server;
  auto token = makeToken();
  if (!token) return tl::unexpected(token.error());
  if (options.secret) server.token_ = std::move(*token);
  const auto secret = tokenPipe(server.token_ + "\n");
  if (!secret) return tl::unexpected(secret.error());
  const pid_t parent = getpid();
  server.pid_ = fork();
  if (server.pid_ < 0) return fail(ErrorCode::kUnavailable, std::string("fork: ") + strerror(errno), options.program);
  if (server.pid_ == 0) becomeServer(arguments, *secret, out->write_end, err->write_end, parent);
  setpgid(server.pid_, server.pid_);  // also here, so that stop() never comes before the child's own call
  for (const int end : {*secret, out->write_end, err->write_end}) close(end);
  server.stdout_ = out->read_end;
  server.stderr_ = err->read_end;
  if (auto listening = server.waitUntilListening(options.keep_going); !listening)
    return tl::unexpected(listening.error());
  return server;
}

ServerProcess::ServerProcess(ServerProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)),
      stdout_(std::exchange(other.stdout_, -1)),
      stderr_(std::exchange(other.stderr_, -1)),
      wait_status_(std::exchange(other.wait_status_, std::nullopt)),
      stdout_text_(std::move(other.stdout_text_)),
      stderr_text_(std::move(other.stderr_text_)),
      log_(std::move(other.log_)),
      last_error_(std::move(other.last_error_)),
      last_text_(std::move(other.last_text_)),
      url_(std::move(other.url_)),
      token_(std::move(other.token_)) {}

Result<void> ServerProcess::waitUntilListening(const std::function<bool()>& keep_going) {
  const auto deadline = Clock::now() + kStartTimeout;
  for (;;) {
    if (keep_going && !keep_going()) return fail(ErrorCode::kUnavailable, "interrupted");
    if (Clock::now() > deadline)
      return fail(ErrorCode::kUnavailable, "the private radiosityd did not start to listen within 60 s");
    const bool alive = running();
    readPipes(50ms);
    while (auto line = takeLine(stdout_text_)) {
      const auto place = line->find(kListening);
      if (place == std::string::npos) continue;
      auto url = client::parseServerUrl(line->substr(place + kListening.size()));
      if (!url) return tl::unexpected(url.error());
      url_ = std::move(*url);
      return {};
    }
    if (!alive) return tl::unexpected(epitaph());
  }
}

void ServerProcess::readPipes(std::chrono::milliseconds wait) {
  std::array<pollfd, 2> ends = {pollfd{stdout_, POLLIN, 0}, pollfd{stderr_, POLLIN, 0}};
  if (stdout_ < 0 && stderr_ < 0) {
    std::this_thread::sleep_for(wait);
    return;
  }
  if (poll(ends.data(), ends.size(), static_cast<int>(wait.count())) < 0) return;  // a signal
  if (stdout_ >= 0 && !drain(stdout_, stdout_text_)) close(std::exchange(stdout_, -1));
  if (stderr_ >= 0 && !drain(stderr_, stderr_text_)) close(std::exchange(stderr_, -1));
  while (auto line = takeLine(stderr_text_)) {
    if (line->empty()) continue;
    LogLine parsed = parseLogLine(*line);
    if (parsed.isError()) last_error_ = parsed.text;
    last_text_ = parsed.text;
    if (log_.size() < kMaxLogLines) log_.push_back(std::move(parsed));
  }
}

std::vector<LogLine> ServerProcess::takeLog() {
  readPipes(0ms);
  if (!url_.host.empty()) stdout_text_.clear();  // nothing more is expected there
  return std::exchange(log_, {});
}

bool ServerProcess::running() {
  if (pid_ < 0 || wait_status_) return false;
  siginfo_t info{};
  // WNOWAIT keeps the process, and so the number of its group, until stop() has ended the group.
  return waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == 0;
}

bool ServerProcess::endsWithin(std::chrono::milliseconds wait) {
  const auto deadline = Clock::now() + wait;
  while (running() && Clock::now() < deadline) {
    readPipes(5ms);
    std::this_thread::sleep_for(5ms);
  }
  return !running();
}

Error ServerProcess::epitaph() {
  stop(0ms);
  const int status = wait_status_.value_or(0);
  std::string why = !last_error_.empty() ? last_error_ : last_text_;
  constexpr std::string_view kItsName = "radiosityd: ";  // it may have named itself already
  if (why.starts_with(kItsName)) why.erase(0, kItsName.size());
  ErrorCode code = ErrorCode::kUnavailable;
  if (WIFSIGNALED(status)) {
    why = std::string("ended by signal ") + strsignal(WTERMSIG(status)) + (why.empty() ? "" : ": " + why);
  } else if (WEXITSTATUS(status) == 2) {
    code = ErrorCode::kBadInput;
  }
  if (why.empty()) why = "ended with status " + std::to_string(WEXITSTATUS(status)) + " and no word why";
  return {code, why, "radiosityd"};
}

void ServerProcess::stop(std::chrono::milliseconds grace) {
  if (pid_ < 0 || wait_status_) return;
  if (running()) kill(pid_, SIGTERM);
  (void)endsWithin(grace);
  kill(-pid_, SIGKILL);
  int status = 0;
  while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  wait_status_ = status;
  readPipes(0ms);
  closePipes();
}

void ServerProcess::closePipes() {
  if (stdout_ >= 0) close(std::exchange(stdout_, -1));
  if (stderr_ >= 0) close(std::exchange(stderr_, -1));
}

}  // namespace radiosity::cli
