// Measuring planes against the path tracer: light at the points of a plane that hangs in a solved room, and what is
// stated of its errors.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/common.hpp>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "tests/accuracy/solve_run.h"
#include "tests/oracle/gltf_file.h"
#include "tests/oracle/path_tracer.h"

namespace radiosity::accuracy {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

fs::path sceneFileOf(const std::string& name) {
  const auto built = fs::path(RADIOSITY_BINARY_DIR) / "scenes" / (name + ".glb");
  return fs::exists(built) ? built : fs::path(RADIOSITY_SHARED_DIR) / "scenes" / (name + ".glb");
}

/// A GLB with one more node in its scene.
void writeWithNode(const fs::path& from, const json& node, const fs::path& to) {
  std::ifstream in(from, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(in), {}};
  std::uint32_t length = 0;
  std::memcpy(&length, all.data() + 12, sizeof length);
  auto gltf = json::parse(all.substr(20, length));
  gltf["scenes"][gltf.value("scene", 0)]["nodes"].push_back(gltf["nodes"].size());
  gltf["nodes"].push_back(node);
  auto text = gltf.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto rest = all.substr(20 + length);
  const std::uint32_t head[] = {0x46546C67, 2, static_cast<std::uint32_t>(20 + text.size() + rest.size()),
                                static_cast<std::uint32_t>(text.size()), 0x4E4F534A};
  std::ofstream out(to, std::ios::binary);
  out.write(reinterpret_cast<const char*>(head), sizeof head);  // NOLINT: bytes of a file
  out << text << rest;
}

struct Point {
  glm::dvec3 position{0.0};
  double lux = 0.0, error = 0.0;
};

std::vector<std::string> cellsOf(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

/// The second table of the file.
std::vector<Point> readCsv(const fs::path& file) {
  std::vector<Point> points;
  std::ifstream in(file);
  bool is_second = false;
  for (std::string line; std::getline(in, line);) {
    if (line == "\r") {
      is_second = true;
      std::getline(in, line);  // names of its columns
      continue;
    }
    if (!is_second) continue;
    const auto cells = cellsOf(line);
    points.push_back({{std::stod(cells.at(4)), std::stod(cells.at(5)), std::stod(cells.at(6))},
                      std::stod(cells.at(7)),
                      std::stod(cells.at(8))});
  }
  return points;
}

double luminous(const glm::dvec3& light) { return 0.2126 * light.x + 0.7152 * light.y + 0.0722 * light.z; }

class SolvedPlane : public testing::TestWithParam<const char*> {};

TEST_P(SolvedPlane, HasTheLightOfThePathTracerWithinWhatIsStated) {
  const auto file = sceneFileOf(GetParam());
  if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto folder = fs::path(RADIOSITY_BINARY_DIR) / "accuracy" / ("SolvedPlane." + std::string(GetParam()));
  fs::create_directories(folder);
  const auto scene = oracle::readGlb(file);
  glm::dvec3 low(std::numeric_limits<double>::max()), high(-low);
  for (const auto& triangle : scene.triangles) {
    for (const auto& corner : triangle.corners) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  const auto middle = 0.5 * (low + high), size = high - low;
  const json plane{{"width", 0.7 * size.x}, {"depth", 0.7 * size.z}, {"columns", 8}, {"rows", 8}};
  writeWithNode(file,
                {{"name", "plane"},
                 {"translation", {middle.x, low.y + 0.4 * size.y, middle.z}},
                 {"extras", {{"radiosityPlane", plane}}}},
                folder / "with_plane.glb");
  const auto csv = folder / "plane.csv";
  const auto run = runSolve(RADIOSITY_CLIENT, folder / "with_plane.glb", folder,
                            {"--error", "0.01", "--time-limit", "60", "--measure", csv.string()}, true);
  ASSERT_TRUE(run.exit_code == 0 || run.exit_code == 3) << run.last_line;
  const auto points = readCsv(csv);
  ASSERT_EQ(points.size(), 64U);
  std::vector<oracle::Footprint> footprints;
  for (const auto& point : points) footprints.push_back(oracle::Footprint::at(point.position, {0, 1, 0}));
  const auto truth =
      oracle::PathTracer(scene).irradiance(footprints, {.samples = 16384, .seed = 7, .leave_out_buried = false});
  double sum = 0.0, of_truth = 0.0, chi = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double light = luminous(truth[i].mean_lux), error = luminous(truth[i].standard_error);
    sum += points[i].lux;
    of_truth += light;
    // Half a percent for texels, of which light that is seen is a mean.
    const double stated = std::hypot(points[i].error, error, 0.005 * light);
    if (stated > 0.0) chi += std::pow((points[i].lux - light) / stated, 2.0) / 64.0;
  }
  RecordProperty("ratio", std::to_string(sum / of_truth));
  RecordProperty("chi", std::to_string(chi));
  EXPECT_NEAR(sum / of_truth, 1.0, 0.01);
  EXPECT_LT(chi, 1.6) << "of 64 points: 1.6 has a chance of a thousandth";
}

INSTANTIATE_TEST_SUITE_P(Scenes, SolvedPlane,
                         testing::Values("cornell", "room_small", "cornell_measured_open", "godot_living_room_panels"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace radiosity::accuracy
