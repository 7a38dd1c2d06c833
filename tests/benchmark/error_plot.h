// A log-log plot of error against time as SVG text. Pure function.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace radiosity::benchmark {

struct ErrorPlot {
  struct Curve {
    std::string name, colour;
    std::vector<std::pair<double, double>> points;  ///< seconds, relative error (0.02 is 2 %); non-positive left out
    bool dashed = false;
  };
  std::string title;
  std::vector<Curve> curves;
  double goal = 0.0;  ///< a thin line across, named in per cent; 0: none
};

[[nodiscard]] std::string toSvg(const ErrorPlot& plot);

}  // namespace radiosity::benchmark
