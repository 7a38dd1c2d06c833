// `radiosity`: the command-line client.
#include <cstdio>
#include <exception>
#include <string>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"

int main(int argc, char** argv) {
  using namespace radiosity::cli;
  catchSignals();
  CLI::App app("", "radiosity");
  Run run;
  try {
    buildApp(app, run);
    app.parse(argc, argv);
    return static_cast<int>(run());
  } catch (const CLI::Success& wanted) {  // --help, --version
    return app.exit(wanted);
  } catch (const CLI::ParseError& error) {
    const auto commands = app.get_subcommands();
    const std::string command = commands.empty() ? "" : " " + commands.front()->get_name();
    std::fprintf(stderr, "radiosity: error: %s\nTry: radiosity%s --help\n", error.what(), command.c_str());
    return static_cast<int>(ExitCode::kBadInput);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "radiosity: error: %s\n", error.what());
    return static_cast<int>(ExitCode::kFailed);
  }
}
