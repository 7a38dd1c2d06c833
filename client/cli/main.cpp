// `radiosity`: the command-line client.
#include <cstdio>
#include <exception>

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
    std::fprintf(stderr, "radiosity: error: %s\nTry: radiosity --help, or radiosity COMMAND --help\n", error.what());
    return static_cast<int>(ExitCode::kBadInput);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "radiosity: error: %s\n", error.what());
    return static_cast<int>(ExitCode::kFailed);
  }
}
