// The command line of radiosityd. Used by main only.
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>

#include "common/log.h"
#include "common/result.h"
#include "server/engine/engine.h"
#include "server/gpu/run/sight.h"
#include "server/net/server_options.h"

namespace radiosity {

struct Options {
  std::string scene;                     ///< path; empty: start without one
  std::filesystem::path state;           ///< folder of what outlives the server; empty: nothing does
  bool reload = false;                   ///< `scene` is taken though there is one in `state`
  std::set<std::string> named_settings;  ///< of `solve`, those on the command line (EngineOptions::named_settings)
  std::size_t checkpoint_bytes = std::size_t{256} << 20;
  net::ServerOptions server;
  engine::SolveSettings solve;
  std::uint64_t max_scene_bytes = 0;     ///< EngineOptions::max_scene_bytes
  std::uint64_t first_texels = 100'000;  ///< EngineOptions::first_texels
  int workers = 0;                       ///< 0: one for each core with a software renderer, one on a GPU
  gpu::Sight sight = gpu::Sight::kAuto;
  std::string log_level = "info";
  LogFormat log_format = LogFormat::kText;
};

/// `argc`, `argv` as main got them. With an exit code instead of options, everything was said already: 0 after --help
/// and --version, 2 for bad usage.
struct ParsedOptions {
  Options options;
  std::optional<int> exit_code;
};
[[nodiscard]] ParsedOptions parseOptions(int argc, const char* const* argv, const std::string& version);

/// Exit codes shared by both programs.
inline constexpr int kExitFailed = 1;
inline constexpr int kExitBadUsage = 2;
/// kBadUsage, kBadInput and the like are the user's to mend (2); the rest is ours or the machine's (1).
[[nodiscard]] int exitCodeOf(const Error& error);

}  // namespace radiosity
