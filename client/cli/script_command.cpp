// radiosity script and wait: many commands on one server, one after the other.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <thread>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/remote.h"
#include "client/cli/report.h"
#include "client/cli/script.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;

// ---- wait ----

struct WaitOptions {
  RemoteOptions server;
  std::optional<double> error;
  std::optional<double> timeout_s;
};

ExitCode wait(const WaitOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto connection = remote->connect();
  if (!connection) return complain(connection.error());
  if (options.error) {  // a solve stops at its target: it has to be asked for no less than is waited for
    const auto status = connection->call(protocol::StatusCall{});
    if (!status) return complain(status.error());
    if (status->settings.target_error > *options.error) {
      const auto done = connection->call(protocol::SolveConfigureCall{.target_error = options.error});
      if (!done) return complain(done.error());
    }
  }
  protocol::SolveWaitCall call{.error = options.error};
  auto patience = std::chrono::milliseconds(protocol::kMaxWaitMs);
  if (options.timeout_s) {
    call.timeout_ms = static_cast<std::uint64_t>(*options.timeout_s * 1000.0);
    patience = std::min(patience, std::chrono::milliseconds(*call.timeout_ms) + 30s);
  }
  const auto status = connection->call(call, patience);
  if (!status) return complain(status.error());
  std::fputs(fmt::format("{}\n", outcomeText(status->progress)).c_str(), stdout);
  if (status->reached.value_or(false)) return ExitCode::kOk;
  if (status->progress.state == "limited") {
    complain(Error{ErrorCode::kUnavailable, "the solve ended above that error: " + status->progress.failure, {}});
    return ExitCode::kShort;
  }
  if (!status->progress.failure.empty())
    return complain(Error{ErrorCode::kUnavailable, "the solve failed: " + status->progress.failure, {}});
  if (status->progress.state == "empty") return complain(Error{ErrorCode::kNotFound, "no scene is loaded", {}});
  complain(Error{ErrorCode::kUnavailable, "the error was not reached in time", {}});
  return ExitCode::kShort;
}

// ---- script ----

struct ScriptOptions {
  RemoteOptions server;
  std::string file;
  bool check = false, quiet = false;
};

Result<std::string> readScript(const std::string& path) {
  if (path == "-") return std::string{std::istreambuf_iterator<char>(std::cin), {}};
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(ErrorCode::kBadInput, "no such file, or no permission to read it", path);
  return std::string{std::istreambuf_iterator<char>(file), {}};
}

/// Commands of the program itself that make no sense on one server, or would read the script's own input.
bool isAllowed(const std::string& command) {
  constexpr std::array kAllowed = {"add",  "edit",     "hide",   "history", "load",  "move",
                                   "redo", "remove",   "rotate", "save",    "scale", "set",
                                   "show", "snapshot", "status", "texel",   "undo",  "wait"};
  return std::find(kAllowed.begin(), kAllowed.end(), command) != kAllowed.end();
}

class ScriptRun {
 public:
  ScriptRun(const ScriptOptions& options, const Script& script) : options_(options), script_(script) {}

  /// A mistake in the last line should not come to light after an hour.
  ExitCode check() {
    return each(true, [this](const ScriptStep& step) {
      Run run;
      return prepare(step, run);
    });
  }

  ExitCode run() {
    return each(false, [this](const ScriptStep& step) {
      if (interrupted()) return complain(Error{ErrorCode::kUnavailable, "interrupted", {}});
      Run run;
      const auto prepared = prepare(step, run);
      if (prepared != ExitCode::kOk) return prepared;
      if (!options_.quiet && step.words[0] != "print") {
        std::string text;
        for (const auto& word : step.words) text += (text.empty() ? "" : " ") + word;
        std::fprintf(stderr, "%s: %s\n", script_.place(step.line).c_str(), text.c_str());
      }
      const auto code = run();
      std::fflush(stdout);  // for whoever reads along
      return code;
    });
  }

 private:
  ExitCode each(bool first_only, const std::function<ExitCode(const ScriptStep&)>& visit) {
    ExitCode code = ExitCode::kOk;
    const auto done = script_.run(first_only, [&](const ScriptStep& step) {
      complainAt(script_.place(step.line));
      code = visit(step);
      return code == ExitCode::kOk;
    });
    complainAt({});
    return done ? code : complain(done.error());
  }

  ExitCode prepare(const ScriptStep& step, Run& run) const {
    const auto& command = step.words[0];
    if (command == "print") {
      run = [step] {
        for (std::size_t i = 1; i < step.words.size(); ++i) fmt::print("{}{}", i > 1 ? " " : "", step.words[i]);
        fmt::print("\n");
        return ExitCode::kOk;
      };
      return ExitCode::kOk;
    }
    if (!isAllowed(command))
      return complain(Error{ErrorCode::kBadInput, "no such command in a script: " + command.substr(0, 40), {}});
    // CLI11 takes them from the last to the first.
    std::vector<std::string> words(step.words.rbegin(), step.words.rend() - 1);
    words.push_back(options_.server.url);
    if (!options_.server.token_file.empty()) words.push_back("--token-file=" + options_.server.token_file);
    if (!options_.server.trust.ca_file.empty()) words.push_back("--ca=" + options_.server.trust.ca_file);
    if (!options_.server.trust.verify) words.emplace_back("--insecure");
    words.push_back(command);
    // The program that parsed the line must live as long as what it prepared.
    const auto app = std::make_shared<CLI::App>("", "radiosity");
    const auto prepared = std::make_shared<Run>();
    buildApp(*app, *prepared);
    try {
      app->parse(words);
    } catch (const CLI::Success&) {
      return complain(Error{ErrorCode::kBadInput, "help is not for scripts", {}});
    } catch (const CLI::ParseError& error) {
      return complain(Error{ErrorCode::kBadInput, command + ": " + error.what(), {}});
    }
    run = [app, prepared] { return (*prepared)(); };
    return ExitCode::kOk;
  }

  const ScriptOptions& options_;
  const Script& script_;
};

ExitCode runScript(const ScriptOptions& options) {
  const auto text = readScript(options.file);
  if (!text) return complain(text.error());
  const auto script = Script::parse(*text, options.file == "-" ? "standard input" : options.file);
  if (!script) return complain(script.error());
  ScriptRun run(options, *script);
  const auto checked = run.check();
  return checked != ExitCode::kOk || options.check ? checked : run.run();
}

}  // namespace

void addWait(CLI::App& app, Run& run) {
  auto options = std::make_shared<WaitOptions>();
  auto& command = *app.add_subcommand("wait", "wait until the scene is solved well enough; exit 3: not reached");
  addRemoteOptions(command, options->server);
  command
      .add_option("--error", options->error,
                  "relative RMS error, 0.02 is 2 %; becomes the target where that is larger (default: the target)")
      ->check(CLI::Range(1e-6, 1.0).description(""))
      ->type_name("FRACTION");
  command.add_option("--timeout", options->timeout_s, "longest wait (default: none)")
      ->check(CLI::Range(0.0, 86400.0).description(""))
      ->type_name("SECONDS");
  command.callback([options, &run] { run = [options] { return wait(*options); }; });
}

void addScript(CLI::App& app, Run& run) {
  auto options = std::make_shared<ScriptOptions>();
  auto& command = *app.add_subcommand("script", "run a file of commands on a server: sweeps, time-lapses, batches");
  addRemoteOptions(command, options->server);
  command.add_option("FILE", options->file, "the script, - for standard input")->required()->type_name("");
  command.add_flag("--check", options->check, "only say whether it can be understood");
  command.add_flag("-q,--quiet", options->quiet, "do not tell each command on stderr");
  command.footer(
      "A line is a command of this program without `radiosity` and URL: set, move, rotate, scale, hide, show, remove,\n"
      "add, edit, undo, redo, history, load, wait, snapshot, save, status, texel; or `print WORD...`. Loops:\n"
      "  for s from 5 to 100 count 20 index i     # $s = 5, 10, ... 100; $i = 00, 01, ... 19\n"
      "    set @lamp.emissiveStrength $s\n"
      "    wait --error 0.02\n"
      "    snapshot -o lamp-$i.png --exposure same  # as bright as the light is, not as each looks best\n"
      "  end\n"
      "  for color in 1,0,0 0,1,0                 # the values one after the other\n"
      "    ...\n"
      "  end\n"
      "$name and ${name} put a loop's value in, $$ is a dollar sign, quotes keep blanks together, # starts a comment.\n"
      "All lines are checked before the first is run; the first that fails ends the script with its exit code.");
  command.callback([options, &run] { run = [options] { return runScript(*options); }; });
}

}  // namespace radiosity::cli
