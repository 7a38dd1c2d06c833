#include "tests/accuracy/solve_run.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace radiosity::accuracy {

SolveRun runSolve(const std::filesystem::path& client, const std::filesystem::path& scene,
                  const std::filesystem::path& folder, const std::vector<std::string>& arguments) {
  std::filesystem::create_directories(folder);
  SolveRun run;
  run.output = folder / (scene.stem().string() + "-lit.glb");
  const auto report = folder / (scene.stem().string() + "-report.json");
  std::filesystem::remove(report);
  std::vector<std::string> words{client.string(),     "solve",    scene.string(),  "-o",
                                 run.output.string(), "--report", report.string(), "-q"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const auto start = std::chrono::steady_clock::now();
  pid_t process = 0;
  if (const int error = posix_spawnp(&process, argv[0], nullptr, nullptr, argv.data(), environ); error != 0) {
    throw std::runtime_error("cannot start " + client.string() + ": " + std::strerror(error));
  }
  int status = 0;
  while (waitpid(process, &status, 0) < 0) {
    if (errno != EINTR) throw std::runtime_error(std::string("waitpid: ") + std::strerror(errno));
  }
  run.wall_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (std::ifstream in(report); in) run.report = nlohmann::json::parse(in);
  return run;
}

}  // namespace radiosity::accuracy
