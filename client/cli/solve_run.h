// What radiosity solve and measure are asked for, and one run of them: scene in, lightmaps or figures of measuring
// planes out, on a private server or on one that runs already.
#pragma once

#include <cstdint>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/measure.h"
#include "client/cli/probes.h"
#include "client/cli/remote.h"
#include "client/cli/sky_options.h"

namespace radiosity::cli {

struct SolveOptions {
  std::string scene, output, report, png, engine;  ///< output: empty for planes alone; of an engine: a folder
  MeasureOptions measure;
  ProbeOptions probes;
  SkyOptions sky;
  std::string state;  ///< folder; empty: an interrupted solve is lost
  RemoteOptions server;
  double error = 0.02;
  double time_limit_s = 0.0;  ///< 0: none
  std::uint64_t texels = 0;   ///< 0: as many as usual
  double texel_size_m = 0.0;  ///< 0: by number
  std::uint64_t seed = 1;
  unsigned workers = 0;          ///< 0: the server's choice
  std::string visibility;        ///< empty: the server's choice
  std::string link_memory;       ///< as radiosityd takes it; empty: the server's choice
  std::string max_scene_memory;  ///< likewise
  bool double_sided = false, uniform = false, means = false;
  Method method = Method::kGather;
  bool unlit = false, error_map = false, quiet = false;
};

/// Solves, and writes what was asked for; says on stderr what went wrong. Blocks until it is done or interrupted.
[[nodiscard]] ExitCode solveScene(const SolveOptions& options);

}  // namespace radiosity::cli
