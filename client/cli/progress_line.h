// The progress line of `solve` and `watch`: pure text, so that it can be tested without a terminal.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace radiosity::cli {

struct ProgressView {
  std::string state;   ///< "solving", "loading", ... as the server says
  double error = 1.0;  ///< relative, total
  double residual = 0.0, sampling = 0.0, variation = 0.0, discretization = 0.0;
  double target_error = 0.02;
  std::uint64_t shots = 0;
  double shots_per_second = 0.0;
  double seconds = 0.0;  ///< of solving
  std::optional<double> seconds_left = {};
  bool show_parts = false;                   ///< the three parts of the error too
  std::optional<double> load_fraction = {};  ///< of a load, in [0, 1]; while `state` is "loading"
  std::string unlit = {};                    ///< to be told in the place of an error that means nothing; empty: it does
};

/// Share of the way from an error of 1 to the target, on a log scale, in [0, 1].
[[nodiscard]] double progressFraction(double error, double target_error);

/// One line of at most `columns` characters, without a newline.
[[nodiscard]] std::string progressLine(const ProgressView& view, int columns);

/// "0.4 s", "42 s", "3 min 05 s", "2 h 10 min"
[[nodiscard]] std::string durationText(double seconds);
/// "1,234,567"
[[nodiscard]] std::string countText(std::uint64_t count);
/// "812 B", "4.2 kB", "37 kB", "1.5 MB": powers of 1000, two digits at least
[[nodiscard]] std::string bytesText(std::uint64_t bytes);
/// What has been sent or has come of a file: "37 kB of 1.5 MB, 2 %"; `total_bytes` 0: not known, "37 kB"
[[nodiscard]] std::string transferText(std::uint64_t done_bytes, std::uint64_t total_bytes);
/// Relative value as a percentage with three digits: "1.98 %", "0.0213 %"
[[nodiscard]] std::string percentText(double value);

/// Writes progress to stderr: on a terminal one line that is rewritten, else a line at most every 2 s; nothing when
/// quiet. Owned and used by one thread.
class ProgressDisplay {
 public:
  explicit ProgressDisplay(bool quiet);
  ~ProgressDisplay();
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  void show(const ProgressView& view);
  /// A line of free text in the same place ("uploading room.glb 40 %").
  void showText(const std::string& text);
  /// A message that stays, above the progress line; printed also when quiet.
  void message(const std::string& text);
  /// Removes the line from a terminal.
  void clear();

 private:
  [[nodiscard]] int columns() const;
  void draw(const std::string& text);

  bool quiet_;
  bool terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace radiosity::cli
