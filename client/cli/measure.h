// Measuring planes of a server's scene: fetched, written to files, told to people.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "client/cli/exit_code.h"
#include "client/cli/remote.h"
#include "protocol/planes.h"

namespace radiosity::cli {

struct MeasureOptions {
  bool wanted = false;
  std::string csv, json;  ///< files; empty: none
  std::string plane;      ///< name or index of a node; empty: all
  bool daylight_factor = false;
};

/// --csv, --json, --plane, --daylight-factor.
void addMeasureOptions(CLI::App& command, MeasureOptions& options);

/// Whether the server's scene has a plane to measure, before anybody waits for its light. kBadInput: it has none, or
/// none of this name or number.
[[nodiscard]] client::CallResult<void> requirePlanes(const Remote& remote, const MeasureOptions& options);

/// Asks the server to measure, and writes the files that are asked for. Returns what to tell people: planesText().
[[nodiscard]] Result<std::string> measurePlanes(const Remote& remote, const MeasureOptions& options,
                                                ProgressDisplay& display);

/// Some lines for each plane. Pure.
[[nodiscard]] std::string planesText(const protocol::Planes& planes);

}  // namespace radiosity::cli
