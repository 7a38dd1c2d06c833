// Light at grids of probes: fetched from a server into a file.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

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
/// Whether the server's scene has these grids, before anybody waits for its light.
[[nodiscard]] Result<void> requireProbes(const Remote& remote, const ProbeOptions& options);
/// Writes the file, whole or not at all. Returns what to tell people: probesText().
[[nodiscard]] Result<std::string> saveProbes(const Remote& remote, const ProbeOptions& options,
                                             ProgressDisplay& display);

/// A line for each grid. Pure.
[[nodiscard]] std::string probesText(const protocol::Probes& probes);

}  // namespace radiosity::cli
