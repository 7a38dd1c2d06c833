#include "tests/benchmark/process_usage.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>

namespace radiosity::benchmark {
namespace {

namespace fs = std::filesystem;

struct Stat {
  std::string name;
  pid_t parent = 0;
  double seconds = 0.0;
};

/// proc(5), /proc/pid/stat: the name stands in brackets and may hold anything.
Stat readStat(const fs::path& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  const std::string all = text.str();
  const auto open = all.find('('), close = all.rfind(')');
  if (open == std::string::npos || close == std::string::npos) return {};
  Stat stat;
  stat.name = all.substr(open + 1, close - open - 1);
  std::istringstream rest(all.substr(close + 1));
  std::string field;
  constexpr int kParent = 4, kUserTicks = 14, kSystemTicks = 15;
  for (int i = 3; rest >> field; ++i) {
    if (i == kParent) stat.parent = static_cast<pid_t>(std::stol(field));
    if (i == kUserTicks || i == kSystemTicks)
      stat.seconds += std::stod(field) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }
  return stat;
}

bool isNumber(const fs::path& path) {
  return path.filename().string().find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

ProcessUsage usageOf(pid_t process) {
  const fs::path folder = "/proc/" + std::to_string(process);
  if (!fs::exists(folder / "stat")) throw std::runtime_error("the server is gone");
  ProcessUsage usage;
  for (const auto& task : fs::directory_iterator(folder / "task")) {
    const auto stat = readStat(task.path() / "stat");
    const bool first = task.path().filename() == std::to_string(process);
    if (first || stat.name == "net") usage.net_seconds += stat.seconds;
  }
  // Threads that have ended count in the sum of the process.
  usage.solve_seconds = readStat(folder / "stat").seconds - usage.net_seconds;
  for (const auto& entry : fs::directory_iterator("/proc")) {
    if (!isNumber(entry.path())) continue;
    const auto stat = readStat(entry.path() / "stat");
    if (stat.parent == process) usage.solve_seconds += stat.seconds;
  }
  std::ifstream memory(folder / "statm");
  std::uint64_t total = 0, resident = 0;
  memory >> total >> resident;
  usage.resident_bytes = resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return usage;
}

}  // namespace radiosity::benchmark
