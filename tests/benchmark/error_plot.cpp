#include "tests/benchmark/error_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace radiosity::benchmark {
namespace {

constexpr double kWidth = 760, kHeight = 440;
constexpr double kLeft = 70, kRight = 190, kTop = 40, kBottom = 56;

/// 1, 2 and 5 of every decade: where the axes may end and lines may lie.
std::vector<double> steps(double low, double high) {
  std::vector<double> all;
  for (int decade = static_cast<int>(std::floor(std::log10(low))); std::pow(10.0, decade) <= high * 1.0001; ++decade) {
    for (const double digit : {1.0, 2.0, 5.0}) {
      const double value = digit * std::pow(10.0, decade);
      if (value >= low * 0.9999 && value <= high * 1.0001) all.push_back(value);
    }
  }
  return all;
}

struct Range {
  double low = 1e300, high = 0.0;

  void include(double value) { low = std::min(low, value), high = std::max(high, value); }
  /// Ends on the next steps outside, so that no point lies on the frame.
  void round() {
    const auto all = steps(low / 10.0, high * 10.0);
    low = *std::prev(std::lower_bound(all.begin(), all.end(), low * 0.999));
    high = *std::upper_bound(all.begin(), all.end(), high * 1.001);
  }
  [[nodiscard]] double share(double value) const { return std::log(value / low) / std::log(high / low); }
};

struct Axes {
  Range time, error;

  [[nodiscard]] double x(double seconds) const { return kLeft + time.share(seconds) * (kWidth - kLeft - kRight); }
  [[nodiscard]] double y(double value) const {
    return kHeight - kBottom - error.share(value) * (kHeight - kTop - kBottom);
  }
};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return out;
}

std::string grid(const Axes& axes) {
  std::string out;
  constexpr double kRightEnd = kWidth - kRight, kBottomEnd = kHeight - kBottom;
  for (const double seconds : steps(axes.time.low, axes.time.high)) {
    const double x = axes.x(seconds);
    out +=
        fmt::format("<line x1=\"{0:.1f}\" y1=\"{1}\" x2=\"{0:.1f}\" y2=\"{2}\" stroke=\"#ddd\"/>", x, kTop, kBottomEnd);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g}</text>\n", x, kBottomEnd + 18, seconds);
  }
  out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">seconds</text>\n", (kLeft + kRightEnd) / 2,
                     kBottomEnd + 40);
  for (const double error : steps(axes.error.low, axes.error.high)) {
    const double y = axes.y(error);
    out +=
        fmt::format("<line x1=\"{1}\" y1=\"{0:.1f}\" x2=\"{2}\" y2=\"{0:.1f}\" stroke=\"#ddd\"/>", y, kLeft, kRightEnd);
    out +=
        fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{:g} %</text>\n", kLeft - 6, y + 4, 100.0 * error);
  }
  return out + fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#888\"/>\n",
                           kLeft, kTop, kRightEnd - kLeft, kBottomEnd - kTop);
}

std::string drawn(const ErrorPlot::Curve& curve, const Axes& axes, double legend_y) {
  std::string line, dots;
  for (const auto& [seconds, error] : curve.points) {
    if (!(seconds > 0.0 && error > 0.0)) continue;
    const double x = axes.x(seconds), y = axes.y(error);
    line += fmt::format("{:.1f},{:.1f} ", x, y);
    if (!curve.dashed)
      dots += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3\" fill=\"{}\"/>", x, y, curve.colour);
  }
  if (line.empty()) return {};
  const auto* dash = curve.dashed ? " stroke-dasharray=\"6 4\"" : "";
  return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{}/>{}\n", line,
                     curve.colour, dash, dots) +
         fmt::format("<text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>\n", kWidth - kRight + 12, legend_y, curve.colour,
                     escaped(curve.name));
}

Axes axesOf(const ErrorPlot& plot) {
  Axes axes;
  for (const auto& curve : plot.curves) {
    for (const auto& [seconds, error] : curve.points) {
      if (!(seconds > 0.0 && error > 0.0)) continue;
      axes.time.include(seconds);
      axes.error.include(error);
    }
  }
  if (!(axes.time.high > 0.0)) axes = {{0.2, 5.0}, {0.02, 0.5}};
  if (plot.goal > 0.0) axes.error.include(plot.goal);
  axes.time.round();
  axes.error.round();
  return axes;
}

}  // namespace

std::string toSvg(const ErrorPlot& plot) {
  const auto axes = axesOf(plot);
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      "<text x=\"{2}\" y=\"24\" font-size=\"15\">{3}: relative RMS error of irradiance</text>\n",
      kWidth, kHeight, kLeft, escaped(plot.title));
  out += grid(axes);
  if (plot.goal > 0.0) {
    out +=
        fmt::format("<line x1=\"{1}\" y1=\"{0:.1f}\" x2=\"{2}\" y2=\"{0:.1f}\" stroke=\"#2a2\" stroke-width=\"1\"/>\n",
                    axes.y(plot.goal), kLeft, kWidth - kRight);
  }
  double legend_y = kTop + 12;
  for (const auto& curve : plot.curves) {
    const auto text = drawn(curve, axes, legend_y);
    if (!text.empty()) legend_y += 18;
    out += text;
  }
  return out + "</svg>\n";
}

}  // namespace radiosity::benchmark
