// The service under load: how soon a viewer sees something, whether a hundred of them keep up and what that costs the
// solve, what one that stalls does to the others, and whether all end with the same pixels. Starts radiosityd as a user
// does. Writes service.md and service.json to --output (or $RADIOSITY_BENCH_OUTPUT).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "client/cli/server_process.h"
#include "client/lib/http.h"
#include "tests/benchmark/process_usage.h"
#include "tests/benchmark/viewer_swarm.h"

namespace radiosity::benchmark {
namespace {

using std::chrono::seconds;

constexpr auto kPatience = seconds(120);
constexpr double kMiB = 1024.0 * 1024.0;

struct Options {
  std::string scene = RADIOSITY_BINARY_DIR "/scenes/cornell.glb", output = "out/bench";
  int viewers = 100, repeats = 100, rounds = 5;
  double error = 0.004;
};

double milliseconds(Clock::duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

/// The smallest value that a share of all is not above.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  return values[std::clamp<std::size_t>(rank, 1, values.size()) - 1];
}

class RunningServer {
 public:
  RunningServer(const Options& options, const std::vector<std::string>& more) {
    auto program = cli::findServerProgram();
    if (!program) throw std::runtime_error(program.error().text());
    std::vector<std::string> arguments = {"--uniform", "--error", fmt::format("{}", options.error), "--max-clients",
                                          "1000"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    auto started = cli::ServerProcess::start({*program, arguments, [] { return true; }, false});
    if (!started) throw std::runtime_error(started.error().text());
    process_.emplace(std::move(*started));
  }
  [[nodiscard]] std::uint16_t port() const { return process_->url().port; }
  [[nodiscard]] ProcessUsage usage() const { return usageOf(process_->pid()); }

  void load(const std::string& scene) const {
    const auto reply = client::httpPutFile({.url = process_->url(), .token = {}, .keep_going = {}, .progress = {}},
                                           "/scene?name=scene.glb", "model/gltf-binary", scene);
    if (!reply || !reply->ok()) throw std::runtime_error("the scene was not loaded");
  }

 private:
  std::optional<cli::ServerProcess> process_;
};

bool stopped(const ViewerRecord& record) {
  return record.state == "converged" || record.state == "timeLimit" || record.state == "failed";
}

/// Until the viewer at hand has been told that the solve is over, and everyone has all of it. The newest version.
std::uint64_t waitForEnd(Swarm& swarm) {
  std::uint64_t newest = 0;
  const auto ended = [&] {
    const auto& watcher = *swarm.records().front();
    if (!stopped(watcher) || watcher.bookmarks.empty()) return false;
    newest = watcher.bookmarks.rbegin()->first;
    return swarm.allHave(newest);
  };
  if (!swarm.run(ended, kPatience)) throw std::runtime_error("the solve, or a viewer, did not come to an end");
  // The state may be told before the last lightmaps: a little later nothing more may come.
  const auto settled = Clock::now() + std::chrono::milliseconds(500);
  (void)swarm.run([&] { return Clock::now() > settled; }, kPatience);
  if (!swarm.run(ended, kPatience)) throw std::runtime_error("a viewer did not get the last version");
  return newest;
}

std::vector<double> firstTiles(const Swarm& swarm) {
  std::vector<double> all;
  for (const auto* record : swarm.records()) all.push_back(milliseconds(*record->first_tile - record->started));
  return all;
}

bool allSeeSomething(const Swarm& swarm) {
  const auto records = swarm.records();
  return std::ranges::all_of(records, [](const auto* record) { return record->first_tile.has_value(); });
}

nlohmann::json measureFirstTile(const Options& options) {
  const RunningServer server(options, {});
  Swarm patient(server.port());
  patient.add(1);
  server.load(options.scene);
  (void)waitForEnd(patient);
  const auto alone = server.usage().resident_bytes;
  std::vector<double> one, many;
  for (int i = 0; i < options.repeats; ++i) {
    Swarm swarm(server.port());
    swarm.add(1);
    if (!swarm.run([&] { return allSeeSomething(swarm); }, kPatience)) throw std::runtime_error("no tile came");
    one.push_back(firstTiles(swarm).front());
  }
  for (int i = 0; i < 3; ++i) {
    Swarm swarm(server.port());
    swarm.add(options.viewers);
    if (!swarm.run([&] { return allSeeSomething(swarm); }, kPatience)) throw std::runtime_error("no tile came");
    for (const auto time : firstTiles(swarm)) many.push_back(time);
  }
  Swarm crowd(server.port());
  const auto before = server.usage();
  crowd.add(options.viewers);
  (void)crowd.run([&] { return crowd.allHave(1); }, kPatience);
  const auto after = server.usage();
  const double each = (static_cast<double>(after.resident_bytes) - static_cast<double>(alone)) / options.viewers / kMiB;
  const double work = 1000.0 * (after.net_seconds - before.net_seconds) / options.viewers;
  return {
      {"one_p50_ms", quantile(one, 0.5)},    {"one_p99_ms", quantile(one, 0.99)}, {"many_p50_ms", quantile(many, 0.5)},
      {"many_p99_ms", quantile(many, 0.99)}, {"cpu_ms_a_viewer", work},           {"memory_mib_a_viewer", each}};
}

/// How long after the first viewer that had a version the others had it.
std::vector<double> delays(const Swarm& swarm) {
  std::map<std::uint64_t, Clock::time_point> first;
  for (const auto* record : swarm.records()) {
    for (const auto& [version, time] : record->bookmarks) {
      const auto [known, added] = first.emplace(version, time);
      if (!added) known->second = std::min(known->second, time);
    }
  }
  std::vector<double> all;
  for (const auto* record : swarm.records())
    for (const auto& [version, time] : record->bookmarks) all.push_back(milliseconds(time - first[version]));
  return all;
}

struct Load {
  int readers = 0, stalled = 0;
};

/// One whole solve that `load` watches, and one more viewer that tells of its end.
nlohmann::json measureSolve(const Options& options, const Load& load) {
  const RunningServer server(options, {});
  Swarm swarm(server.port());
  swarm.add(std::max(1, load.readers));
  swarm.add(load.stalled, false);
  const auto settled = Clock::now() + std::chrono::milliseconds(500);
  (void)swarm.run([&] { return Clock::now() > settled; }, kPatience);
  const auto before = server.usage();
  const auto start = Clock::now();
  server.load(options.scene);
  const auto newest = waitForEnd(swarm);
  const auto after = server.usage();

  Swarm fresh(server.port());
  fresh.add(1);
  if (!fresh.run([&] { return fresh.allHave(newest); }, kPatience)) throw std::runtime_error("no tiles for a newcomer");
  int same = 0;
  std::size_t fewest = SIZE_MAX, most = 0;
  for (const auto* record : swarm.records()) {
    if (!record->reads) continue;
    same += record->crc == fresh.records().front()->crc ? 1 : 0;
    fewest = std::min(fewest, record->bookmarks.size());
    most = std::max(most, record->bookmarks.size());
  }
  const auto late = delays(swarm);
  return {{"readers", std::max(1, load.readers)},
          {"stalled", load.stalled},
          {"seconds", milliseconds(Clock::now() - start) / 1000.0},
          {"solve_cpu_seconds", after.solve_seconds - before.solve_seconds},
          {"net_cpu_seconds", after.net_seconds - before.net_seconds},
          {"memory_mib", static_cast<double>(after.resident_bytes) / kMiB},
          {"versions_fewest", fewest},
          {"versions_most", most},
          {"delay_p50_ms", quantile(late, 0.5)},
          {"delay_p99_ms", quantile(late, 0.99)},
          {"same_pixels", same}};
}

/// The same load in every round: other programs and the machine's own moods are in each of them, so medians
/// of rounds in turn tell more than one long solve of each load.
struct LoadResult {
  std::vector<double> solve_cpu, late_p99, memory;
  int readers = 0, same_pixels = 0, viewers = 0;
  std::size_t fewest = SIZE_MAX, most = SIZE_MAX;  ///< versions had whole, in the worst round

  void add(const nlohmann::json& solve) {
    solve_cpu.push_back(solve["solve_cpu_seconds"]);
    memory.push_back(solve["memory_mib"]);
    late_p99.push_back(solve["delay_p99_ms"]);
    readers = solve["readers"];
    same_pixels += solve["same_pixels"].get<int>();
    viewers += readers;
    const auto whole = solve["versions_fewest"].get<std::size_t>(), all = solve["versions_most"].get<std::size_t>();
    if (most == SIZE_MAX || all - whole > most - fewest) fewest = whole, most = all;
  }
};

/// "median (smallest to largest)" of how much more each of `values` is than its partner in `grounds`, in per cent.
std::string changes(const std::vector<double>& values, const std::vector<double>& grounds) {
  std::vector<double> all;
  for (std::size_t i = 0; i < values.size(); ++i) all.push_back(100.0 * (values[i] / grounds[i] - 1.0));
  return fmt::format("{:+.1f} % ({:+.1f} to {:+.1f})", quantile(all, 0.5), quantile(all, 0.0), quantile(all, 1.0));
}

std::string report(const nlohmann::json& all) {
  const auto& first = all["first_tile"];
  const auto number = [](const nlohmann::json& value) { return fmt::format("{:.3g}", value.get<double>()); };
  std::string out = "# The service under load\n\n| claim | target | measured |\n|---|---:|---:|\n";
  const auto row = [&](std::string_view claim, std::string_view target, const std::string& value) {
    out += fmt::format("| {} | {} | {} |\n", claim, target, value);
  };
  std::array<LoadResult, 3> loads;  // as run() measures them: one viewer, all, and all with one that never reads
  for (std::size_t i = 0; i < all["solves"].size(); ++i) loads[i % loads.size()].add(all["solves"][i]);
  const auto& [alone, crowd, stalled] = loads;
  const auto rounds = alone.solve_cpu.size();
  row("connect to first tile, solved scene, 1 viewer, p99", "250 ms", number(first["one_p99_ms"]) + " ms");
  row(fmt::format("the same, {} at once, p99", crowd.readers), "250 ms", number(first["many_p99_ms"]) + " ms");
  row("processor time of the server for a viewer, from connecting to having everything", "",
      number(first["cpu_ms_a_viewer"]) + " ms");
  row("memory a viewer", "4 MiB", number(first["memory_mib_a_viewer"]) + " MiB");
  row(fmt::format("processor time of the solve with {} viewers, beyond that with one, {} rounds", crowd.readers,
                  rounds),
      "5 %", changes(crowd.solve_cpu, alone.solve_cpu));
  row("versions that the slowest viewer had whole, of those the quickest had", "",
      fmt::format("{} of {}", crowd.fewest, crowd.most));
  row("delay behind the first viewer, p99", "", fmt::format("{:.3g} ms", quantile(crowd.late_p99, 0.5)));
  row("the same with one that never reads, change", "10 %", changes(stalled.late_p99, crowd.late_p99));
  row("memory of the server with it", "flat",
      fmt::format("{:.3g} MiB, {:.3g} without", quantile(stalled.memory, 0.5), quantile(crowd.memory, 0.5)));
  for (const auto& load : loads)
    row(fmt::format("viewers of {} ({} rounds of {}) whose last pixels are the server's", load.viewers, rounds,
                    load.readers),
        "all", fmt::format("{}", load.same_pixels));
  return out;
}

int run(const Options& options) {
  nlohmann::json all;
  all["first_tile"] = measureFirstTile(options);
  for (int round = 0; round < options.rounds; ++round)
    for (const Load load : {Load{1, 0}, Load{options.viewers, 0}, Load{options.viewers - 1, 1}})
      all["solves"].push_back(measureSolve(options, load));
  const auto text = report(all);
  std::fputs(text.c_str(), stdout);
  std::filesystem::create_directories(options.output);
  std::ofstream(std::filesystem::path(options.output) / "service.md") << text;
  std::ofstream(std::filesystem::path(options.output) / "service.json") << all.dump(2) << "\n";
  return 0;
}

}  // namespace
}  // namespace radiosity::benchmark

int main(int argc, char** argv) try {
  radiosity::benchmark::Options options;
  if (const char* folder = std::getenv("RADIOSITY_BENCH_OUTPUT")) options.output = folder;
  CLI::App app{"radiosityd under load: first tile, a hundred viewers, one that stalls."};
  app.add_option("--scene", options.scene, "the scene")->capture_default_str();
  app.add_option("--error", options.error, "target of the solves")->capture_default_str();
  app.add_option("--viewers", options.viewers, "how many watch at once")
      ->check(CLI::Range(2, 900))
      ->capture_default_str();
  app.add_option("--repeats", options.repeats, "connections one after the other")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "solves of each load, in turn")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--output", options.output, "folder for service.md and service.json")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return radiosity::benchmark::run(options);
} catch (const std::exception& error) {
  std::fprintf(stderr, "service_load: %s\n", error.what());
  return 1;
}
