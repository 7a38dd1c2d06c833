// Runs `radiosity solve` as a user does and collects what it wrote.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/accuracy/lit_scene.h"

namespace radiosity::accuracy {

struct SolveRun {
  int exit_code = -1;  ///< 128 + signal when it was killed
  double wall_seconds = 0.0;
  nlohmann::json report;  ///< of --report; null when none was written
  std::filesystem::path output;
  std::string last_line;  ///< of what it printed; all of it is in NAME-solve.log beside the output
};

/// `client` is the radiosity program (or a name in PATH); `arguments` come after those for files. Output and report go
/// to `folder`, which is made. Texels are of one size (--uniform) unless `chosen`. Throws std::runtime_error when the
/// program cannot be started.
[[nodiscard]] SolveRun runSolve(const std::filesystem::path& client, const std::filesystem::path& scene,
                                const std::filesystem::path& folder, const std::vector<std::string>& arguments,
                                bool chosen = false);

/// Lights a scene as `radiosity solve --sky OPTION` had it; as there, a sky of the scene's own comes first. Throws
/// std::invalid_argument for an option that is none.
void setSky(const std::string& option, LitScene& lit);

}  // namespace radiosity::accuracy
