#include "server/scene/import/node_transform.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <utility>

#include "server/scene/import/import_instancing.h"

namespace radiosity::scene {
namespace {

glm::dvec3 vec3(const std::vector<double>& v, double otherwise) {
  return v.empty() ? glm::dvec3(otherwise) : glm::dvec3(v[0], v[1], v[2]);
}

glm::dquat rotationOf(const tinygltf::Node& node) {
  const auto& q = node.rotation;
  return q.empty() ? glm::dquat(1.0, 0.0, 0.0, 0.0) : glm::normalize(glm::dquat(q[3], q[0], q[1], q[2]));
}

bool hasDirection(const glm::dvec3& v) { return glm::length(v) > 0.0 && std::isfinite(glm::length(v)); }

}  // namespace

bool isFinite(const glm::dmat4& m) {
  for (int c = 0; c < 4; ++c) {
    for (int r = 0; r < 4; ++r) {
      if (!std::isfinite(m[c][r])) return false;
    }
  }
  return true;
}

glm::dmat4 localMatrix(const tinygltf::Node& node) {
  if (!node.matrix.empty()) return glm::make_mat4(node.matrix.data());
  return Trs{vec3(node.translation, 0.0), rotationOf(node), vec3(node.scale, 1.0)}.matrix();
}

std::vector<glm::dmat4> worldMatrices(const tinygltf::Model& model) {
  std::vector<bool> has_parent(model.nodes.size(), false);
  for (const auto& node : model.nodes) {
    for (const auto child : node.children) has_parent[static_cast<std::size_t>(child)] = true;
  }
  std::vector<glm::dmat4> world(model.nodes.size(), glm::dmat4(1.0));
  std::vector<std::size_t> stack;
  for (std::size_t n = 0; n < model.nodes.size(); ++n) {
    if (!has_parent[n]) stack.push_back(n);
  }
  while (!stack.empty()) {
    const auto n = stack.back();
    stack.pop_back();
    world[n] = world[n] * localMatrix(model.nodes[n]);  // until now it was its parent's
    for (const auto child : model.nodes[n].children) {
      world[static_cast<std::size_t>(child)] = world[n];
      stack.push_back(static_cast<std::size_t>(child));
    }
  }
  return world;
}

glm::dmat4 cameraPose(const glm::dmat4& parent, const tinygltf::Node& node) {
  const auto unscaled = node.matrix.empty()
                            ? Trs{vec3(node.translation, 0.0), rotationOf(node), glm::dvec3(1.0)}.matrix()
                            : localMatrix(node);
  const auto world = parent * unscaled;
  glm::dmat4 pose(1.0);
  pose[3] = world[3];
  const auto back = glm::dvec3(world[2]);
  if (!hasDirection(back)) return pose;
  const auto z = glm::normalize(back);
  const auto up = glm::dvec3(world[1]) - z * glm::dot(z, glm::dvec3(world[1]));
  if (!hasDirection(up)) return pose;
  const auto y = glm::normalize(up);
  pose[0] = glm::dvec4(glm::cross(y, z), 0.0);
  pose[1] = glm::dvec4(y, 0.0);
  pose[2] = glm::dvec4(z, 0.0);
  return pose;
}

}  // namespace radiosity::scene
