// A lit scene as the files that an engine shows as they are. Pure functions of values; any thread.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/engines/engine.h"
#include "client/engines/lit_scene.h"

namespace radiosity::engines {

struct OutputFile {
  std::string name;
  Bytes bytes;
};

/// What a server states of its light, as fractions; none where it does not know.
struct StatedError {
  std::optional<double> total, p95;
};

struct Exported {
  std::vector<OutputFile> files;
  double loss = 0.0;      ///< of encoding: RMS over all texels, relative to their RMS
  std::size_t baked = 0;  ///< lamps that were taken out
};

/// scene.glb, the pages, lighting.json (what they are, and how far off), and the engine's pages and scripts. Memory:
/// a copy of the scene, and the files. Errors: too large for a GLB, or what the EXR library says.
[[nodiscard]] Result<Exported> exportFor(const Engine& engine, LitScene scene, const StatedError& error);

}  // namespace radiosity::engines
