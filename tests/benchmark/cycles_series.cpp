// Runs Blender on cycles_bake.py and judges what it baked.
#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/benchmark/error_series.h"

namespace radiosity::benchmark {
namespace {

using nlohmann::json;

constexpr std::size_t kLeastPlainShare = 4;  // a quarter of the texels stands for the scene; less does not

std::string quoted(const std::string& word) {
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

struct ProgramOutput {
  std::vector<json> lines;   ///< of those that begin with "bake: "
  std::string last_message;  ///< of the script
  int status = -1;
  double seconds = 0.0;
};

ProgramOutput runBlender(const std::string& command) {
  ProgramOutput output;
  const auto start = std::chrono::steady_clock::now();
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return output;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) {
    const std::string line(buffer.data());
    if (line.rfind("bake: ", 0) == 0) {
      if (auto value = json::parse(line.substr(6), nullptr, false); value.is_object()) output.lines.push_back(value);
    } else if (line.find("cycles_bake.py: ") == 0 || line.find("not found") != std::string::npos) {
      output.last_message = line.substr(0, line.find('\n'));
    }
  }
  const int status = pclose(pipe);
  output.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  output.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return output;
}

}  // namespace

CyclesSeries bakeWithCycles(const std::filesystem::path& glb, const accuracy::LitScene& lit,
                            const accuracy::Reference& reference, const SeriesOptions& options) {
  CyclesSeries series;
  const auto plain = static_cast<std::size_t>(
      std::count_if(reference.texels.begin(), reference.texels.end(), [](const auto& texel) { return texel.plain; }));
  if (plain * kLeastPlainShare < reference.texels.size() || plain == 0) {
    series.missing = fmt::format(
        "only {} of {} texels are one-sided, visible and not black, and a bake knows one side and what it reflects",
        plain, reference.texels.size());
    return series;
  }
  const auto folder = glb.parent_path() / "cycles";
  std::string sizes;
  for (const auto& page : lit.pages) sizes += fmt::format("{}{}x{}", sizes.empty() ? "" : ",", page.width, page.height);
  const auto effort = options.cycles_samples.empty() ? fmt::format("--seconds {:g}", options.cycles_seconds)
                                                     : "--samples " + quoted(options.cycles_samples);
  const auto output = runBlender(fmt::format(
      "{} --background --factory-startup --python {} -- {} {} {} --page-sizes {} 2>&1", quoted(options.blender),
      quoted(options.bake_script.string()), quoted(glb.string()), quoted(folder.string()), effort, sizes));
  series.start_seconds = output.seconds;
  for (const auto& line : output.lines) {
    series.version = line.value("version", series.version);
    if (!line.contains("samples")) continue;
    CyclesRow row{line.value("samples", 0), line.value("seconds", 0.0), {}};
    std::vector<accuracy::Page> pages;
    for (const auto& page : line.value("pages", std::vector<std::string>{})) {
      pages.push_back(accuracy::readPfm(folder / page));
    }
    row.plain = accuracy::measureTexels(pages, reference, accuracy::TexelChoice::kPlain);
    series.start_seconds -= row.seconds;
    std::fprintf(stderr, "%s Cycles, %d samples, %.2f s: solver error %.2f %%, bias %+.2f %%\n", glb.stem().c_str(),
                 row.samples, row.seconds, 100 * row.plain.solverRms(), 100 * row.plain.bias);
    series.rows.push_back(row);
  }
  if (output.status != 0 || series.rows.empty()) {
    series.missing =
        output.last_message.empty() ? fmt::format("blender ended with {}", output.status) : output.last_message;
    std::fprintf(stderr, "%s Cycles: %s\n", glb.stem().c_str(), series.missing.c_str());
  }
  return series;
}

}  // namespace radiosity::benchmark
