// radiosity save --for and solve --for: what a server has, as a folder that an engine shows as it is.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/cli/progress_line.h"
#include "client/cli/remote.h"
#include "client/engines/export.h"
#include "common/result.h"

namespace radiosity::cli {

/// --for. Other names than those of engines are refused with a list of these.
CLI::Option* addEngineOption(CLI::App& command, std::string& engine);

struct EngineRequest {
  std::string engine, folder;
  std::string png_path = {};  ///< a picture as well; empty: none
};

/// kBadUsage where the folder cannot be written; to be asked before a long solve rather than after.
[[nodiscard]] Result<void> checkEngineFolder(const std::string& folder);

struct EngineSaved {
  std::vector<std::string> paths;
  std::string note;  ///< what the encoding loses, lamps, and what to do next: lines for the user
};
/// Downloads a scene and writes its files, all of them or none. For Blender it runs Blender, if that is installed, to
/// make scene.blend. Errors: as of saveScene(); a full disk; Blender failed.
[[nodiscard]] Result<EngineSaved> saveForEngine(const Remote& remote, const EngineRequest& request,
                                                const engines::StatedError& error, ProgressDisplay& display);

}  // namespace radiosity::cli
