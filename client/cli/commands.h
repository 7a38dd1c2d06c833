// The commands of `radiosity`. Each add function puts one subcommand on the app; parsing it stores what to run.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "client/cli/exit_code.h"

namespace radiosity::cli {

using Run = std::function<ExitCode()>;

void addSolve(CLI::App& app, Run& run);
void addWatch(CLI::App& app, Run& run);
void addLoad(CLI::App& app, Run& run);
void addEdit(CLI::App& app, Run& run);
/// set, move, rotate, scale, hide, show, remove, add, undo, redo, history.
void addQuickEdits(CLI::App& app, Run& run);
void addWait(CLI::App& app, Run& run);
void addScript(CLI::App& app, Run& run);
void addStatus(CLI::App& app, Run& run);
void addTexel(CLI::App& app, Run& run);
void addMeasure(CLI::App& app, Run& run);
void addProbes(CLI::App& app, Run& run);
void addSnapshot(CLI::App& app, Run& run);
void addSave(CLI::App& app, Run& run);

/// The whole program, with all its commands. `run` is set by parsing.
void buildApp(CLI::App& app, Run& run);

}  // namespace radiosity::cli
