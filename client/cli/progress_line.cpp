#include "client/cli/progress_line.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/one_line.h"

namespace radiosity::cli {
namespace {

constexpr int kBarColumns = 24;
constexpr int kMinColumnsForBar = 60;

std::string bar(double fraction) {
  const int filled = static_cast<int>(std::floor(fraction * kBarColumns));
  return "[" + std::string(static_cast<std::size_t>(filled), '#') +
         std::string(static_cast<std::size_t>(kBarColumns - filled), '.') + "] ";
}

}  // namespace

double progressFraction(double error, double target_error) {
  if (!(error < 1.0)) return 0.0;  // also NaN
  if (error <= target_error) return 1.0;
  if (!(target_error > 0.0)) return 0.0;
  return std::clamp(std::log(error) / std::log(target_error), 0.0, 1.0);
}

std::string percentText(double value) {
  if (!std::isfinite(value)) return "?";
  return fmt::format("{:.3g} %", 100.0 * value);
}

std::string countText(std::uint64_t count) {
  std::string text = std::to_string(count);
  for (auto place = static_cast<std::ptrdiff_t>(text.size()) - 3; place > 0; place -= 3)
    text.insert(static_cast<std::size_t>(place), ",");
  return text;
}

std::string bytesText(std::uint64_t bytes) {
  if (bytes < 1000) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes) / 1000.0;
  const char* unit = "kB";
  for (const char* larger : {"MB", "GB", "TB"}) {
    if (value < 999.5) break;  // what would be written as 1000
    value /= 1000.0;
    unit = larger;
  }
  return value < 9.95 ? fmt::format("{:.1f} {}", value, unit) : fmt::format("{:.0f} {}", value, unit);
}

std::string transferText(std::uint64_t done_bytes, std::uint64_t total_bytes) {
  if (total_bytes == 0) return bytesText(done_bytes);
  const double percent = 100.0 * static_cast<double>(done_bytes) / static_cast<double>(total_bytes);
  return fmt::format("{} of {}, {:.0f} %", bytesText(done_bytes), bytesText(total_bytes), percent);
}

std::string durationText(double seconds) {
  constexpr double kLongest = 1e9;
  if (!std::isfinite(seconds) || seconds < 0.0 || seconds > kLongest) return "?";
  if (seconds < 9.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<std::uint64_t>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

namespace {

std::string loadLine(double fraction, int columns) {
  const double done = std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0;
  return (columns >= kMinColumnsForBar ? bar(done) : "") + fmt::format("{:.0f} %", 100.0 * done);
}

std::string solveLine(const ProgressView& view, int columns) {
  std::string line;
  if (columns >= kMinColumnsForBar) line += bar(progressFraction(view.error, view.target_error));
  line += view.unlit.empty() ? fmt::format("error {} of {}", percentText(view.error), percentText(view.target_error))
                             : oneLine(view.unlit);
  if (view.show_parts && view.unlit.empty())
    line += fmt::format(" (residual {}, sampling {}, variation {}, discretization {})", percentText(view.residual),
                        percentText(view.sampling), percentText(view.variation), percentText(view.discretization));
  constexpr double kFastest = 1e18;  // a server may say anything
  line += fmt::format("  {} shots, {}/s", countText(view.shots),
                      countText(static_cast<std::uint64_t>(std::min(std::max(0.0, view.shots_per_second), kFastest))));
  line += "  " + durationText(view.seconds);
  if (view.seconds_left && view.error > view.target_error) line += ", " + durationText(*view.seconds_left) + " left";
  return line;
}

}  // namespace

std::string progressLine(const ProgressView& view, int columns) {
  auto line = view.state + " ";
  line += view.load_fraction ? loadLine(*view.load_fraction, columns) : solveLine(view, columns);
  if (columns > 0 && line.size() > static_cast<std::size_t>(columns)) line.resize(static_cast<std::size_t>(columns));
  return line;
}

ProgressDisplay::ProgressDisplay(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressDisplay::~ProgressDisplay() { clear(); }

int ProgressDisplay::columns() const {
  constexpr int kFallback = 79;
  constexpr int kNoLimit = 0;
  if (!terminal_) return kNoLimit;
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kFallback;
  return size.ws_col - 1;  // the last column would wrap on some terminals
}

void ProgressDisplay::show(const ProgressView& view) {
  if (!quiet_) draw(progressLine(view, terminal_ ? columns() : 1000));
}

void ProgressDisplay::showText(const std::string& text) {
  if (quiet_) return;
  const int limit = columns();
  draw(limit > 0 ? text.substr(0, static_cast<std::size_t>(limit)) : text);
}

void ProgressDisplay::draw(const std::string& text) {
  using namespace std::chrono_literals;
  const auto now = std::chrono::steady_clock::now();
  const auto interval = terminal_ ? std::chrono::milliseconds(50) : std::chrono::milliseconds(2000);
  if (last_ != std::chrono::steady_clock::time_point{} && now - last_ < interval) return;
  last_ = now;
  const auto line = oneLine(text);
  if (terminal_) {
    std::fprintf(stderr, "\r\033[K%s", line.c_str());
    drawn_ = true;
  } else {
    std::fprintf(stderr, "%s\n", line.c_str());
  }
  std::fflush(stderr);
}

void ProgressDisplay::message(const std::string& text) {
  clear();
  std::fprintf(stderr, "%s\n", oneLine(text).c_str());
}

void ProgressDisplay::clear() {
  if (!drawn_) return;
  std::fputs("\r\033[K", stderr);
  std::fflush(stderr);
  drawn_ = false;
}

}  // namespace radiosity::cli
