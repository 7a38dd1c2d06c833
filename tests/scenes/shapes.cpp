#include "tests/scenes/shapes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>
#include <vector>

namespace radiosity::test_scenes {
namespace {

struct FaceCorners {
  BoxFace bit;
  std::array<std::array<int, 3>, 4> corners;  // 0: low, 1: high; counter-clockwise seen from outside
};

constexpr std::array<FaceCorners, 6> kFaces{{
    {kXMin, {{{0, 0, 0}, {0, 0, 1}, {0, 1, 1}, {0, 1, 0}}}},
    {kXMax, {{{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}}}},
    {kYMin, {{{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}}}},
    {kYMax, {{{0, 1, 0}, {0, 1, 1}, {1, 1, 1}, {1, 1, 0}}}},
    {kZMin, {{{0, 0, 0}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}}},
    {kZMax, {{{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}}}},
}};

using Triangle = std::array<glm::dvec3, 3>;

std::vector<Triangle> icosahedron() {
  const double g = std::numbers::phi;
  const std::array<glm::dvec3, 12> v{{{-1, g, 0},
                                      {1, g, 0},
                                      {-1, -g, 0},
                                      {1, -g, 0},
                                      {0, -1, g},
                                      {0, 1, g},
                                      {0, -1, -g},
                                      {0, 1, -g},
                                      {g, 0, -1},
                                      {g, 0, 1},
                                      {-g, 0, -1},
                                      {-g, 0, 1}}};
  constexpr std::array<std::array<std::size_t, 3>, 20> kTriangles{
      {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
       {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
       {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  std::vector<Triangle> triangles;
  for (const auto& t : kTriangles) {
    triangles.push_back({glm::normalize(v[t[0]]), glm::normalize(v[t[1]]), glm::normalize(v[t[2]])});
  }
  return triangles;
}

std::vector<Triangle> subdivide(const std::vector<Triangle>& coarse) {
  std::vector<Triangle> fine;
  fine.reserve(coarse.size() * 4);
  for (const auto& [a, b, c] : coarse) {
    const auto ab = glm::normalize(a + b);
    const auto bc = glm::normalize(b + c);
    const auto ca = glm::normalize(c + a);
    fine.push_back({a, ab, ca});
    fine.push_back({ab, b, bc});
    fine.push_back({ca, bc, c});
    fine.push_back({ab, bc, ca});
  }
  return fine;
}

double totalArea(const std::vector<Triangle>& triangles) {
  double area = 0.0;
  for (const auto& [a, b, c] : triangles) area += 0.5 * glm::length(glm::cross(b - a, c - a));
  return area;
}

void appendLegs(Object& object, double half_x, double half_z, double thickness, double height, std::uint32_t material) {
  for (const double sx : {-1.0, 1.0}) {
    for (const double sz : {-1.0, 1.0}) {
      const glm::dvec3 outer(sx * half_x, 0.0, sz * half_z);
      const glm::dvec3 inner(sx * (half_x - thickness), height, sz * (half_z - thickness));
      const glm::dvec3 low(std::min(outer.x, inner.x), 0.0, std::min(outer.z, inner.z));
      const glm::dvec3 high(std::max(outer.x, inner.x), height, std::max(outer.z, inner.z));
      appendBox(object, low, high, allFaces(material), kYMin | kYMax);
    }
  }
}

}  // namespace

BoxMaterials allFaces(std::uint32_t material) {
  BoxMaterials materials{};
  materials.fill(material);
  return materials;
}

void appendBox(Object& object, glm::dvec3 low, glm::dvec3 high, const BoxMaterials& materials, unsigned left_out,
               bool inwards) {
  for (std::size_t f = 0; f < kFaces.size(); ++f) {
    if ((left_out & kFaces[f].bit) != 0) continue;
    Polygon polygon{{}, materials[f]};
    for (const auto& c : kFaces[f].corners) {
      polygon.corners.emplace_back(c[0] == 0 ? low.x : high.x, c[1] == 0 ? low.y : high.y, c[2] == 0 ? low.z : high.z);
    }
    if (inwards) std::reverse(polygon.corners.begin(), polygon.corners.end());
    object.polygons.push_back(std::move(polygon));
  }
}

void appendSphere(Object& object, glm::dvec3 centre, double radius, unsigned subdivisions, std::uint32_t material,
                  bool inwards, bool smooth) {
  auto triangles = icosahedron();
  for (unsigned i = 0; i < subdivisions; ++i) triangles = subdivide(triangles);
  const double blown_up = radius * std::sqrt(4.0 * std::numbers::pi / totalArea(triangles));
  for (const auto& [a, b, c] : triangles) {
    Polygon polygon{{centre + blown_up * a, centre + blown_up * b, centre + blown_up * c}, material};
    if (smooth) polygon.normals = {glm::normalize(a), glm::normalize(b), glm::normalize(c)};
    if (inwards) std::swap(polygon.corners[1], polygon.corners[2]);
    if (inwards && smooth) polygon.normals = {-polygon.normals[0], -polygon.normals[2], -polygon.normals[1]};
    object.polygons.push_back(std::move(polygon));
  }
}

void appendCylinder(Object& object, glm::dvec3 foot, double radius, double height, unsigned sides,
                    std::uint32_t material) {
  const glm::dvec3 up(0.0, height, 0.0);
  const auto outwards = [&](unsigned side) {
    const double angle = 2.0 * std::numbers::pi * side / sides;
    return glm::dvec3(std::sin(angle), 0.0, std::cos(angle));
  };
  Polygon top{{}, material}, bottom{{}, material};
  for (unsigned side = 0; side < sides; ++side) {
    const auto a = outwards(side), b = outwards(side + 1);
    const auto low = foot + radius * a, next = foot + radius * b;
    object.polygons.push_back({{low, next, next + up, low + up}, material, {a, b, b, a}});
    top.corners.push_back(low + up);
    bottom.corners.insert(bottom.corners.begin(), low);
  }
  object.polygons.push_back(std::move(top));
  object.polygons.push_back(std::move(bottom));
}

void turn(Object& object, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  for (auto& polygon : object.polygons) {
    for (auto& corner : polygon.corners) {
      const auto d = corner - object.origin;
      corner = object.origin + glm::dvec3(c * d.x + s * d.z, d.y, -s * d.x + c * d.z);
    }
    for (auto& n : polygon.normals) n = glm::dvec3(c * n.x + s * n.z, n.y, -s * n.x + c * n.z);
  }
}

void move(Object& object, glm::dvec3 by) {
  object.origin += by;
  for (auto& polygon : object.polygons) {
    for (auto& corner : polygon.corners) corner += by;
  }
}

Object makeChair(std::string name, std::uint32_t frame_material, std::uint32_t seat_material) {
  constexpr double kHalf = 0.21;
  constexpr double kSeatBottom = 0.41;
  constexpr double kSeatTop = 0.45;
  Object chair{std::move(name), {}, {}};
  appendLegs(chair, kHalf - 0.01, kHalf - 0.01, 0.04, kSeatBottom, frame_material);
  appendBox(chair, {-kHalf, kSeatBottom, -kHalf}, {kHalf, kSeatTop, kHalf}, allFaces(seat_material));
  appendBox(chair, {-kHalf + 0.01, kSeatTop, -kHalf + 0.01}, {kHalf - 0.01, 0.85, -kHalf + 0.04},
            allFaces(seat_material), kYMin);
  return chair;
}

Object makeTable(std::string name, double width_x, double depth_z, std::uint32_t leg_material,
                 std::uint32_t top_material) {
  constexpr double kTopBottom = 0.71;
  constexpr double kTopTop = 0.74;
  Object table{std::move(name), {}, {}};
  const glm::dvec3 half(width_x / 2, 0.0, depth_z / 2);
  appendLegs(table, half.x - 0.03, half.z - 0.03, 0.06, kTopBottom, leg_material);
  appendBox(table, {-half.x, kTopBottom, -half.z}, {half.x, kTopTop, half.z}, allFaces(top_material));
  return table;
}

Object makeCeilingLamp(std::string name, glm::dvec3 origin, double width_x, double depth_z, std::uint32_t body_material,
                       std::uint32_t light_material) {
  Object lamp{std::move(name), {}, {}};
  auto materials = allFaces(body_material);
  materials[2] = light_material;  // kYMin
  appendBox(lamp, {-width_x / 2, 0.0, -depth_z / 2}, {width_x / 2, 0.05, depth_z / 2}, materials);
  move(lamp, origin);
  return lamp;
}

}  // namespace radiosity::test_scenes
