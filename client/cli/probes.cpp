// radiosity probes, and the same of a solve.
#include "client/cli/probes.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "client/cli/commands.h"
#include "client/lib/atomic_file.h"
#include "client/lib/http.h"
#include "common/one_line.h"

namespace radiosity::cli {
namespace {

std::string queryOf(const ProbeOptions& options) {
  return options.spacing ? fmt::format("spacing={}", *options.spacing) : std::string();
}

Result<protocol::Probes> fetchPlaces(const Remote& remote, const ProbeOptions& options) {
  const auto reply = client::httpGet(remote.http(), "/probes.json?light=false&" + queryOf(options));
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) {
    auto error = httpError(*reply, remote.url.text());
    // The scene's fault, or that of what was asked for, and not the server's; a 404 of others has no code.
    const bool is_found = reply->status == 404 && error.code == ErrorCode::kNotFound;
    if (reply->status == 400 || reply->status == 413 || is_found) error.code = ErrorCode::kBadInput;
    return tl::unexpected(std::move(error));
  }
  auto places = protocol::decodeHttpProbes(reply->body);
  if (!places)
    return fail(ErrorCode::kUnavailable, "the answer to /probes.json: " + places.error().text(), remote.url.text());
  return places;
}

double lengthOf(const std::array<double, 3>& step) { return std::hypot(step[0], step[1], step[2]); }

std::string gridName(const protocol::ProbeGrid& grid) {
  if (!grid.node) return "the whole scene";
  return grid.name.empty() ? fmt::format("node {}", *grid.node) : oneLine(grid.name);
}

/// Into `file`, which is not committed.
Result<protocol::ProbesHead> fetchLight(const Remote& remote, const ProbeOptions& options, client::AtomicFile& file) {
  const std::string path = options.output.ends_with(".bin") ? "/probes.bin?" : "/probes.json?";
  const auto reply = client::httpGetToFile(remote.http(), path + queryOf(options), file);
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) return tl::unexpected(httpError(*reply, remote.url.text()));
  const auto start = file.start(protocol::kMaxProbesHeadBytes);
  if (!start) return tl::unexpected(start.error());
  auto head = protocol::decodeProbesHead(*start);
  if (!head) return fail(ErrorCode::kUnavailable, "the file of probes: " + head.error().text(), remote.url.text());
  return head;
}

struct CommandOptions {
  RemoteOptions server;
  ProbeOptions probes;
  bool quiet = false;
};

ExitCode tellProbes(const CommandOptions& options) {
  if (auto ready = checkProbes(options.probes); !ready) return complain(ready.error());
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  ProgressDisplay display(options.quiet);
  const auto told = saveProbes(*remote, options.probes, display);
  if (!told) return complain(told.error());
  std::fputs(told->c_str(), stdout);
  return ExitCode::kOk;
}

}  // namespace

void addProbeOptions(CLI::App& command, ProbeOptions& options, const char* spacing_name, const char* output_name) {
  command
      .add_option(spacing_name, options.spacing,
                  "a grid of probes over the whole scene, at most so far apart (default: those of nodes with "
                  "extras.radiosityProbes)")
      ->check(CLI::Range(1e-9, protocol::kMaxProbeSpacing).description(""))
      ->type_name("METRES");
  command
      .add_option(output_name, options.output,
                  "the light at probes as spherical harmonics, with standard errors, validity and distances")
      ->type_name("FILE.json|FILE.bin");
}

Result<void> checkProbes(const ProbeOptions& options) {
  if (options.output.empty()) {
    if (!options.spacing) return {};
    return fail(ErrorCode::kBadUsage, "probes need a file to be written to: --probes-out FILE.json or FILE.bin");
  }
  if (!options.output.ends_with(".json") && !options.output.ends_with(".bin"))
    return fail(ErrorCode::kBadUsage, "the name of the file of probes must end with .json or .bin", options.output);
  return checkOutputs({options.output});
}

Result<void> requireOwnFile(const ProbeOptions& options, const std::vector<std::string>& others) {
  namespace fs = std::filesystem;
  if (options.output.empty()) return {};
  std::error_code error;
  const auto placeOf = [&](const std::string& path) { return fs::weakly_canonical(fs::absolute(path, error), error); };
  for (const auto& other : others) {
    if (other.empty()) continue;
    if (placeOf(other) == placeOf(options.output) || fs::equivalent(other, options.output, error))
      return fail(ErrorCode::kBadUsage, "the file of probes would replace " + other, options.output);
  }
  return {};
}

Result<void> requireProbes(const Remote& remote, const ProbeOptions& options) {
  const auto places = fetchPlaces(remote, options);
  if (!places) return tl::unexpected(places.error());
  return {};
}

Result<std::string> saveProbes(const Remote& remote, const ProbeOptions& options, ProgressDisplay& display) {
  constexpr int kAttempts = 3;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const auto places = fetchPlaces(remote, options);
    if (!places) return tl::unexpected(places.error());
    auto file = client::AtomicFile::create(options.output);
    if (!file) return tl::unexpected(file.error());
    display.showText("probes");
    const auto head = fetchLight(remote, options, *file);
    display.clear();
    if (!head) return tl::unexpected(head.error());
    if (head->revision != places->revision) continue;  // an edit in between: these might be other grids
    if (auto done = file->commit(); !done) return tl::unexpected(done.error());
    return options.output + "\n" + probesText(*places, head->measured);
  }
  return fail(ErrorCode::kBusy, "the scene is being changed faster than its probes can be fetched; try again",
              remote.url.text());
}

std::string probesText(const protocol::Probes& probes, const std::vector<std::uint64_t>& measured) {
  std::string text;
  for (std::size_t g = 0; g < probes.grids.size(); ++g) {
    const auto& grid = probes.grids[g];
    const auto name = gridName(grid);
    text +=
        fmt::format("{}: {} x {} x {} probes, {:.3g} x {:.3g} x {:.3g} m apart", name, grid.counts[0], grid.counts[1],
                    grid.counts[2], lengthOf(grid.steps[0]), lengthOf(grid.steps[1]), lengthOf(grid.steps[2]));
    const auto all = grid.counts[0] * grid.counts[1] * grid.counts[2];
    const auto seen = g < measured.size() ? std::min(measured[g], all) : all;
    if (seen < all)
      text += fmt::format("; {} inside solids or behind walls have {}", all - seen,
                          seen > 0 ? "the light of those beside them" : "no light");
    text += "\n";
    if (seen == 0) warn(name + ": all probes lie inside solids or behind walls, and are black");
  }
  return text;
}

void addProbes(CLI::App& app, Run& run) {
  auto options = std::make_shared<CommandOptions>();
  auto& command = *app.add_subcommand("probes", "save the light at grids of probes of a server's scene as it is now");
  addRemoteOptions(command, options->server);
  addProbeOptions(command, options->probes, "--spacing", "-o,--output");
  command.get_option("--output")->required();
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
  command.callback([options, &run] { run = [options] { return tellProbes(*options); }; });
}

}  // namespace radiosity::cli
