#include "common/memory_limit.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

namespace radiosity {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

/// A number of bytes in a file; kUnlimited where there is none ("max").
std::uint64_t bytesIn(const fs::path& file) {
  std::ifstream in(file);
  std::uint64_t bytes = 0;
  return in >> bytes ? bytes : kUnlimited;
}

/// Of a control group and of all above it: `file` in each folder from `root` down to `group`.
std::uint64_t leastOf(fs::path root, const std::string& group, const char* file) {
  auto least = bytesIn(root / file);
  for (const auto& part : fs::path(group).relative_path()) least = std::min(least, bytesIn((root /= part) / file));
  return least;
}

/// Lines "0::/group" (version 2) and "4:memory:/group" (version 1). In a container the group may be named as it is
/// outside; its root is then what holds.
std::uint64_t controlGroupLimit() {
  auto least = kUnlimited;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const auto first = line.find(':');
    const auto second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const auto controllers = line.substr(first + 1, second - first - 1);
    const auto group = line.substr(second + 1);
    if (controllers.empty()) least = std::min(least, leastOf("/sys/fs/cgroup", group, "memory.max"));
    if (controllers == "memory")
      least = std::min(least, leastOf("/sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
  }
  return least;
}

std::uint64_t findLimit() {
  const auto pages = sysconf(_SC_PHYS_PAGES);
  const auto page = sysconf(_SC_PAGESIZE);
  auto least =
      pages > 0 && page > 0 ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page) : kUnlimited;
  rlimit space{};
  if (getrlimit(RLIMIT_AS, &space) == 0 && space.rlim_cur != RLIM_INFINITY)
    least = std::min<std::uint64_t>(least, space.rlim_cur);
  return std::min(least, controlGroupLimit());
}

}  // namespace

std::uint64_t memoryLimitBytes() {
  static const auto limit = findLimit();
  return limit;
}

}  // namespace radiosity
