#include "client/cli/commands.h"

namespace radiosity::cli {

void buildApp(CLI::App& app, Run& run) {
  app.description(
      "Global illumination for glTF scenes: solves a scene into lightmaps, or talks to a running radiosityd.\n"
      "URL is HOST:PORT, http://HOST:PORT or ws://HOST:PORT/ws. Results go to stdout, progress and messages to "
      "stderr.");
  app.footer(
      "Exit codes: 0 done, the asked error reached; 1 failed; 2 bad usage or bad input;\n"
      "            3 ended above the asked error (time limit, memory for links), output written; 75 interrupted.\n"
      "`radiosity COMMAND --help` tells the options of a command, with units and defaults.");
  app.set_version_flag("--version", "radiosity 0.1.0");
  app.require_subcommand(1);
  app.get_formatter()->column_width(34);
  addSolve(app, run);
  addWatch(app, run);
  addLoad(app, run);
  addEdit(app, run);
  addQuickEdits(app, run);
  addWait(app, run);
  addScript(app, run);
  addStatus(app, run);
  addTexel(app, run);
  addMeasure(app, run);
  addProbes(app, run);
  addSnapshot(app, run);
  addSave(app, run);
}

}  // namespace radiosity::cli
