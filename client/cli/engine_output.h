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

struct EngineSaved {
  std::vector<std::string> paths;
  std::vector<std::string> warnings;  ///< what is not as one would expect: Blender failed, files of the user stay
  std::vector<std::string> notes;     ///< what the encoding loses, lamps, and what to do next
};
/// Downloads a scene and writes its files; where any of them cannot be written, none. Pages and scripts in the folder
/// that are not ours stay, and with them all that we have of these. For Blender it runs Blender, if that is installed,
/// to make scene.blend; what it complains of is a warning. Errors: as of saveScene(); a full disk; kCancelled.
[[nodiscard]] Result<EngineSaved> saveForEngine(const Remote& remote, const EngineRequest& request,
                                                const engines::StatedError& error, ProgressDisplay& display);

/// The warnings on stderr, and, unless `quiet`, the notes: each a line.
void tellSaved(const EngineSaved& saved, bool quiet);

}  // namespace radiosity::cli
