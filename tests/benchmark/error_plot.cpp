#include "tests/benchmark/error_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace radiosity::benchmark {
namespace {

constexpr double kWidth = 640, kHeight = 420;
constexpr double kLeft = 70, kRight = 130, kTop = 40, kBottom = 50;

struct Range {
  double low = 1e300, high = -1e300;  // decades

  void include(double value) {
    low = std::min(low, std::floor(std::log10(value)));
    high = std::max(high, std::ceil(std::log10(value)));
  }
  [[nodiscard]] double share(double value) const { return (std::log10(value) - low) / std::max(1.0, high - low); }
};

struct Axes {
  Range time, error;

  [[nodiscard]] double x(double seconds) const { return kLeft + time.share(seconds) * (kWidth - kLeft - kRight); }
  [[nodiscard]] double y(double value) const {
    return kHeight - kBottom - error.share(value) * (kHeight - kTop - kBottom);
  }
};

std::string grid(const Axes& axes) {
  std::string out;
  for (double d = axes.time.low; d <= axes.time.high; ++d) {
    const double x = axes.x(std::pow(10.0, d));
    out +=
        fmt::format(R"(<line x1="{0:.1f}" y1="{1}" x2="{0:.1f}" y2="{2}" stroke="#ddd"/>)", x, kTop, kHeight - kBottom);
    out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{:g} s</text>\n", x, kHeight - kBottom + 18,
                       std::pow(10.0, d));
  }
  for (double d = axes.error.low; d <= axes.error.high; ++d) {
    const double y = axes.y(std::pow(10.0, d));
    out +=
        fmt::format(R"(<line x1="{1}" y1="{0:.1f}" x2="{2}" y2="{0:.1f}" stroke="#ddd"/>)", y, kLeft, kWidth - kRight);
    out += fmt::format("<text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{:g} %</text>\n", kLeft - 6, y + 4,
                       100.0 * std::pow(10.0, d));
  }
  return out;
}

std::string curve(const ErrorPlot::Curve& curve, const Axes& axes, double legend_y) {
  std::string line;
  std::string dots;
  for (const auto& [seconds, error] : curve.points) {
    if (!(seconds > 0.0 && error > 0.0)) continue;
    line += fmt::format("{:.1f},{:.1f} ", axes.x(seconds), axes.y(error));
    dots += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="3" fill="{}"/>)", axes.x(seconds), axes.y(error),
                        curve.colour);
  }
  return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>{}\n", line, curve.colour,
                     dots) +
         fmt::format("<text x=\"{}\" y=\"{}\" fill=\"{}\">{}</text>\n", kWidth - kRight + 10, legend_y, curve.colour,
                     curve.name);
}

}  // namespace

std::string toSvg(const ErrorPlot& plot) {
  Axes axes;
  bool any = false;
  for (const auto& c : plot.curves) {
    for (const auto& [seconds, error] : c.points) {
      if (!(seconds > 0.0 && error > 0.0)) continue;
      axes.time.include(seconds);
      axes.error.include(error);
      any = true;
    }
  }
  if (!any) axes = {{-1, 1}, {-3, 0}};
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
      "<text x=\"{2}\" y=\"24\" font-size=\"15\">{3}: relative RMS error of irradiance against solve time</text>\n",
      kWidth, kHeight, kLeft, plot.title);
  out += grid(axes);
  double legend_y = kTop + 12;
  for (const auto& c : plot.curves) {
    out += curve(c, axes, legend_y);
    legend_y += 18;
  }
  return out + "</svg>\n";
}

}  // namespace radiosity::benchmark
