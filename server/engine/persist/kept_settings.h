// Settings as the store keeps them: by name, as text.
#pragma once

#include <map>
#include <set>
#include <string>

#include "server/engine/engine.h"

namespace radiosity::engine {

/// Those that clients can change; numbers that read back as the same bits.
[[nodiscard]] std::map<std::string, std::string> keptSettings(const SolveSettings& settings);

/// `settings` with what was kept, except for those that are `named`: "targetError", "timeLimit", "texels" (both sizes),
/// "seed", "sky", "doubleSided". What makes no sense is passed over.
[[nodiscard]] SolveSettings withKept(SolveSettings settings, const std::map<std::string, std::string>& kept,
                                     const std::set<std::string>& named);

}  // namespace radiosity::engine
