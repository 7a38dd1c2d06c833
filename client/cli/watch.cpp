// radiosity watch: follows a solve from afar.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/remote.h"
#include "client/cli/report.h"
#include "common/one_line.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;

constexpr auto kRefreshInterval = 1000ms;

struct WatchOptions {
  RemoteOptions server;
  bool follow = false, quiet = false;
};

class Watch {
 public:
  Watch(const WatchOptions& options, Remote remote)
      : options_(options), remote_(std::move(remote)), display_(options.quiet) {}

  ExitCode run() {
    bool was_connected = false;
    while (!interrupted()) {
      auto connection = remote_.connect();
      // At first a wrong address should be told at once; later a server that restarts is worth waiting for.
      const bool refused = !connection && connection.error().rpc.has_value();
      if (!connection && (!was_connected || refused)) return end(complainCleared(connection.error()));
      std::string why;
      if (connection) {
        was_connected = true;
        back_off_.reset();
        if (const auto code = follow(*connection, why)) return end(*code);
      } else {
        why = connection.error().error.text();
      }
      if (!interrupted()) waitBeforeRetry(why);
    }
    return end(ExitCode::kInterrupted);
  }

 private:
  ExitCode end(ExitCode code) {
    display_.clear();
    return interrupted() ? ExitCode::kInterrupted : code;
  }

  ExitCode complainCleared(const client::CallFailure& failure) {
    display_.clear();
    return complain(failure);
  }

  /// Until the solve ends (a value) or the connection breaks (none, with the reason in `why`).
  std::optional<ExitCode> follow(client::Connection& connection, std::string& why) {
    connection.onNotification([this](const protocol::Notification& note) { onNotification(note); });
    while (!interrupted()) {
      ask_now_ = false;
      tellOfLoad(connection);
      const auto status = connection.call(protocol::StatusCall{});
      if (!status && status.error().rpc) return complainCleared(status.error());
      if (!status) {
        why = status.error().error.text();
        return std::nullopt;
      }
      target_error_ = status->settings.target_error;
      show(status->progress);
      if (const auto code = ending(status->progress)) return code;
      const auto next = std::chrono::steady_clock::now() + kRefreshInterval;
      while (!interrupted() && !ask_now_ && std::chrono::steady_clock::now() < next) {
        if (const auto polled = connection.poll(kRefreshInterval); !polled) {
          why = polled.error().text();
          return std::nullopt;
        }
      }
    }
    return ExitCode::kInterrupted;
  }

  std::optional<ExitCode> ending(const protocol::Progress& progress) {
    if (options_.follow) return std::nullopt;
    const bool stopped = progress.state == "converged" || progress.state == "timeLimit" ||
                         progress.state == "limited" || progress.state == "failed";
    if (!stopped) return std::nullopt;
    display_.clear();
    if (progress.state == "failed")
      return complain(Error{ErrorCode::kUnavailable, "the solve failed: " + progress.failure, remote_.url.text()});
    const std::string why = progress.state == "limited" ? "limited (" + oneLine(progress.failure) + ")" : "time limit";
    std::printf("%s: %s\n", progress.state == "converged" ? "converged" : why.c_str(), outcomeText(progress).c_str());
    return progress.state == "converged" ? ExitCode::kOk : ExitCode::kShort;
  }

  void show(const protocol::Progress& progress) {
    ProgressView view = viewOf(progress, target_error_);
    view.show_parts = true;
    display_.show(view);
  }

  void onNotification(const protocol::Notification& note) {
    if (const auto* progress = std::get_if<protocol::ProgressNote>(&note)) {
      show(progress->progress);
      ask_now_ = ask_now_ ||
                 (!options_.follow && progress->progress.state != "solving" && progress->progress.state != "loading");
    } else if (const auto* patched = std::get_if<protocol::ScenePatched>(&note)) {
      display_.message(fmt::format("revision {}: edited by {}", patched->revision,
                                   patched->by.empty() ? "somebody" : oneLine(patched->by)));
    } else if (const auto* loaded = std::get_if<protocol::SceneLoaded>(&note)) {
      loaded_ = loaded->revision;
      ask_now_ = true;  // of whom: from in here nothing can be asked
    } else if (std::holds_alternative<protocol::Draining>(note)) {
      display_.message("the server is shutting down");
    }
  }

  /// Whose scene it is that has come, as far as the server knows. A scene whose first light is shown is not in the
  /// history yet; it is told of again when it is.
  void tellOfLoad(client::Connection& connection) {
    if (!loaded_) return;
    const auto revision = *std::exchange(loaded_, std::nullopt);
    const auto history = connection.call(protocol::SceneHistoryCall{});
    if (history && history->revision < revision) return;
    if (revision == std::exchange(told_, revision)) return;
    const auto text = history ? changeText(history->revisions, revision) : std::string("another scene");
    display_.message(fmt::format("revision {}: {}", revision, text));
  }

  static std::string changeText(const std::vector<protocol::PastRevision>& revisions, std::uint64_t revision) {
    const auto past = std::find_if(revisions.begin(), revisions.end(),
                                   [revision](const auto& each) { return each.revision == revision; });
    if (past == revisions.end()) return "another scene";
    const auto who = past->by.empty() ? "somebody" : oneLine(past->by);
    return past->kind == "load" ? fmt::format("{} loaded by {}", oneLine(past->summary), who)
                                : fmt::format("edited by {}", who);  // an undo that was too long to be told in full
  }

  void waitBeforeRetry(const std::string& why) {
    const auto wait = back_off_.next();
    display_.message(
        fmt::format("{}; trying again in {}", why, durationText(static_cast<double>(wait.count()) / 1000.0)));
    const auto until = std::chrono::steady_clock::now() + wait;
    while (!interrupted() && std::chrono::steady_clock::now() < until) std::this_thread::sleep_for(20ms);
  }

  const WatchOptions& options_;
  Remote remote_;
  ProgressDisplay display_;
  client::BackOff back_off_;
  double target_error_ = 0.02;
  bool ask_now_ = false;
  std::optional<std::uint64_t> loaded_;  ///< revision of a load that was not told of yet
  std::uint64_t told_ = 0;               ///< of the last that was
};

}  // namespace

void addWatch(CLI::App& app, Run& run) {
  auto options = std::make_shared<WatchOptions>();
  auto& command = *app.add_subcommand("watch", "follow a server's solve until it has converged");
  addRemoteOptions(command, options->server);
  command.add_flag("--follow", options->follow, "go on after the solve has converged, until Ctrl-C");
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr, only the outcome on stdout");
  command.callback([options, &run] {
    run = [options] {
      auto remote = remoteFrom(options->server);
      return remote ? Watch(*options, std::move(*remote)).run() : complain(remote.error());
    };
  });
}

}  // namespace radiosity::cli
