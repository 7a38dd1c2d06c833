// Light at grids of probes: fetched from a server into a file.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/exit_code.h"
#include "client/cli/remote.h"
#include "protocol/probes.h"

namespace radiosity::cli {

struct ProbeOptions {
  std::optional<double> spacing;  ///< metres, over the whole scene; none: the scene's own grids
  std::string output;             ///< .json or .bin; empty: none
};

/// `--SPACING_NAME`, and `output_name`, for which a file is wanted.
void addProbeOptions(CLI::App& command, ProbeOptions& options, const char* spacing_name, const char* output_name);

/// kBadUsage: the file has another ending, or there is a spacing and no file.
[[nodiscard]] Result<void> checkProbes(const ProbeOptions& options);
/// kBadUsage: the file of probes is one of these, which are read or written, too; empty paths are none.
[[nodiscard]] Result<void> requireOwnFile(const ProbeOptions& options, const std::vector<std::string>& others);
/// Whether the server's scene has these grids, before anybody waits for its light.
[[nodiscard]] Result<void> requireProbes(const Remote& remote, const ProbeOptions& options);
/// Writes the file, whole or not at all, of one revision. Returns what to tell people: probesText(). kBusy: edits come
/// faster than files.
[[nodiscard]] Result<std::string> saveProbes(const Remote& remote, const ProbeOptions& options,
                                             ProgressDisplay& display);

/// A line for each grid, with how many probes of it were not measured; warns of one of which none was. `measured`:
/// protocol::ProbesHead; a grid that it lacks was measured wholly.
[[nodiscard]] std::string probesText(const protocol::Probes& probes, const std::vector<std::uint64_t>& measured);

}  // namespace radiosity::cli
