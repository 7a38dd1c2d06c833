#include "tests/accuracy/solve_run.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

#include "protocol/sky.h"

namespace radiosity::accuracy {
namespace {

/// Starts a program whose output, both streams, goes to a file.
pid_t spawnInto(const std::filesystem::path& log, std::vector<std::string> words) {
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  pid_t process = 0;
  const int error = posix_spawnp(&process, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw std::runtime_error("cannot start " + words[0] + ": " + std::strerror(error));
  return process;
}

std::string lastLine(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  return last;
}

}  // namespace

SolveRun runSolve(const std::filesystem::path& client, const std::filesystem::path& scene,
                  const std::filesystem::path& folder, const std::vector<std::string>& arguments, bool chosen) {
  std::filesystem::create_directories(folder);
  SolveRun run;
  run.output = folder / (scene.stem().string() + "-lit.glb");
  const auto report = folder / (scene.stem().string() + "-report.json");
  std::filesystem::remove(report);
  std::vector<std::string> words{client.string(),     "solve",    scene.string(),  "-o",
                                 run.output.string(), "--report", report.string(), "-q"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (!chosen) words.emplace_back("--uniform");
  const auto log = folder / (scene.stem().string() + "-solve.log");
  const auto start = std::chrono::steady_clock::now();
  const pid_t process = spawnInto(log, std::move(words));
  int status = 0;
  while (waitpid(process, &status, 0) < 0) {
    if (errno != EINTR) throw std::runtime_error(std::string("waitpid: ") + std::strerror(errno));
  }
  run.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  run.last_line = lastLine(log);
  if (std::ifstream in(report); in) run.report = nlohmann::json::parse(in);
  return run;
}

void setSky(const std::string& option, LitScene& lit) {
  const auto sky = protocol::parseSky(option);
  if (!sky) throw std::invalid_argument(sky.error().text());
  if (lit.traced().has_sky) return;
  const auto& [upper, lower] = *sky;
  for (auto* scene : {&lit.scene, lit.unlit ? &*lit.unlit : nullptr}) {
    if (scene == nullptr) continue;
    scene->sky_upper = {upper[0], upper[1], upper[2]};
    scene->sky_lower = {lower[0], lower[1], lower[2]};
    scene->has_sky = true;
  }
}

}  // namespace radiosity::accuracy
