#include "tests/oracle/view3d_suite.h"

#include <cctype>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

#include "tests/oracle/dense_solver.h"

namespace radiosity::oracle {
namespace {

View3dSurface parseSurface(std::istringstream& words, const std::map<int, glm::dvec3>& vertices) {
  View3dSurface surface;
  for (int i = 0; i < 4; ++i) {
    int vertex = 0;
    words >> vertex;
    if (vertex != 0) surface.corners.push_back(vertices.at(vertex));
  }
  words >> surface.base >> surface.combined_with;
  --surface.base;  // 1-based; 0: none
  --surface.combined_with;
  if (!words) throw std::runtime_error("bad surface line");
  return surface;
}

/// For each surface of the input, the row of the result it belongs to.
std::vector<std::size_t> resultRows(const std::vector<View3dSurface>& surfaces, std::size_t& count) {
  std::vector<std::size_t> rows(surfaces.size());
  count = 0;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const int with = surfaces[i].combined_with;
    rows[i] = with >= 0 ? rows.at(static_cast<std::size_t>(with)) : count++;
  }
  return rows;
}

}  // namespace

std::vector<View3dSurface> readView3dInput(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  std::map<int, glm::dvec3> vertices;
  std::vector<View3dSurface> surfaces;
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream words(line.substr(0, line.find('!')));
    std::string keyword;
    int number = 0;
    words >> keyword;
    if (keyword == "End") break;
    if (keyword.size() != 1) continue;
    const char kind = static_cast<char>(std::toupper(static_cast<unsigned char>(keyword[0])));
    if (kind == 'F' && (words >> keyword) && keyword != "3") throw std::runtime_error("only F 3 files are read");
    if (kind == 'V') {
      glm::dvec3 v;
      words >> number >> v.x >> v.y >> v.z;
      vertices[number] = v;
    } else if (kind == 'S') {
      words >> number;
      surfaces.push_back(parseSurface(words, vertices));
    }
  }
  return surfaces;
}

ViewFactors readView3dOutput(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string program;
  std::string version;
  int ignored = 0;
  std::size_t count = 0;
  in >> program >> version >> ignored >> ignored >> ignored >> count;
  ViewFactors result;
  result.areas.resize(count);
  result.factors.resize(count * count);
  for (auto& value : result.areas) in >> value;
  for (auto& value : result.factors) in >> value;
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return result;
}

ViewFactors viewFactors(const std::vector<View3dSurface>& surfaces, const IntegrationOptions& options) {
  std::vector<DensePatch> patches;
  std::vector<Corners> occluders;
  for (const auto& surface : surfaces) {
    patches.push_back({surface.corners, {}, {}});
    occluders.push_back(surface.corners);
  }
  const auto single = formFactors(patches, occluders, options);
  std::size_t count = 0;
  const auto rows = resultRows(surfaces, count);
  // exchange areas A F add: + for a surface itself, - for it in the base that it is cut out of
  const auto n = surfaces.size();
  std::vector<std::vector<std::pair<std::size_t, double>>> parts(n);
  ViewFactors result{std::vector<double>(count, 0.0), std::vector<double>(count * count, 0.0)};
  for (std::size_t i = 0; i < n; ++i) {
    parts[i].emplace_back(rows[i], 1.0);
    if (surfaces[i].base >= 0) parts[i].emplace_back(rows[static_cast<std::size_t>(surfaces[i].base)], -1.0);
    for (const auto& [row, sign] : parts[i]) result.areas[row] += sign * area(surfaces[i].corners);
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const double exchange = area(surfaces[i].corners) * single[i * n + j];
      for (const auto& [row, row_sign] : parts[i]) {
        for (const auto& [column, column_sign] : parts[j]) {
          result.factors[row * count + column] += row_sign * column_sign * exchange / result.areas[row];
        }
      }
    }
  }
  return result;
}

}  // namespace radiosity::oracle
