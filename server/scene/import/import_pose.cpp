#include "server/scene/import/import_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <optional>
#include <utility>

#include "common/task.h"
#include "server/geometry/normal_matrix.h"
#include "server/scene/import/accessor.h"
#include "server/scene/import/node_transform.h"

namespace radiosity::scene {
namespace {

/// Vertices that targets move may be so many times those that a scene may have.
constexpr std::size_t kMostTargets = 16;
constexpr double kMostJointWeight = 1e6;

bool isInRange(const glm::dvec3& p) {
  constexpr double kMost = std::numeric_limits<float>::max();
  return std::abs(p.x) <= kMost && std::abs(p.y) <= kMost && std::abs(p.z) <= kMost;
}

/// JOINTS_n and WEIGHTS_n.
struct Influences {
  AccessorReader joints, weights;
  std::string joints_pointer, weights_pointer;
};

Result<std::vector<Influences>> influencesOf(const ImportContext& context, const tinygltf::Primitive& source,
                                             const std::string& pointer) {
  std::vector<Influences> sets;
  for (std::size_t n = 0;; ++n) {
    const auto suffix = std::to_string(n);
    const auto joints = source.attributes.find("JOINTS_" + suffix),
               weights = source.attributes.find("WEIGHTS_" + suffix);
    if (joints == source.attributes.end() || weights == source.attributes.end()) return sets;
    const auto at = [&](const auto& found) { return pointer + "/attributes/" + found->first; };
    const auto& of_joints = context.model.accessors[static_cast<std::size_t>(joints->second)];
    const auto& of_weights = context.model.accessors[static_cast<std::size_t>(weights->second)];
    const auto type = of_joints.componentType;
    const bool whole = type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                       type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    if (!whole || of_joints.type != TINYGLTF_TYPE_VEC4)
      return context.bad(at(joints), "accessor must be VEC4 of an unsigned integer type");
    if (of_weights.type != TINYGLTF_TYPE_VEC4) return context.bad(at(weights), "accessor must be VEC4");
    auto joint_reader = AccessorReader::open(context.document, context.model, static_cast<std::size_t>(joints->second));
    if (!joint_reader) return tl::unexpected(joint_reader.error());
    auto weight_reader =
        AccessorReader::open(context.document, context.model, static_cast<std::size_t>(weights->second));
    if (!weight_reader) return tl::unexpected(weight_reader.error());
    sets.push_back({joint_reader->unnormalized(), std::move(*weight_reader), at(joints), at(weights)});
  }
}

/// What the joints of a skin make of each vertex together. glTF has weights add up to 1; those that do not are scaled.
class VertexSkin {
 public:
  VertexSkin(const ImportContext& context, std::vector<Influences> sets, const std::vector<glm::dmat4>& joints)
      : context_(context), sets_(std::move(sets)), joints_(joints) {}

  Result<glm::dmat4> at(std::size_t vertex) {
    glm::dmat4 matrix(0.0);
    double sum = 0.0;
    for (const auto& set : sets_) {
      const auto joint = set.joints.at(vertex), weight = set.weights.at(vertex);
      for (std::size_t c = 0; c < 4; ++c) {
        if (!(std::abs(weight[c]) <= kMostJointWeight))
          return context_.bad(set.weights_pointer, "weight of vertex " + std::to_string(vertex) + " is out of range");
        if (weight[c] <= 0.0) continue;
        const auto one = jointAt(set, vertex, joint[c]);
        if (!one) return tl::unexpected(one.error());
        matrix += weight[c] * **one;
        sum += weight[c];
      }
    }
    if (sum > 0.0) return matrix / sum;
    ++free_;
    const auto one = jointAt(sets_.front(), vertex, sets_.front().joints.at(vertex)[0]);
    if (!one) return tl::unexpected(one.error());
    return **one;
  }

  /// Vertices without any weight, which follow the first joint that they name.
  [[nodiscard]] std::size_t freeCount() const { return free_; }

 private:
  [[nodiscard]] Result<const glm::dmat4*> jointAt(const Influences& set, std::size_t vertex, double joint) const {
    if (joint < static_cast<double>(joints_.size())) return &joints_[static_cast<std::size_t>(joint)];
    return context_.bad(set.joints_pointer, "joint of vertex " + std::to_string(vertex) + " is " +
                                                std::to_string(static_cast<std::uint64_t>(joint)) +
                                                ", but the skin has " + std::to_string(joints_.size()));
  }

  const ImportContext& context_;
  std::vector<Influences> sets_;
  const std::vector<glm::dmat4>& joints_;
  std::size_t free_ = 0;
};

}  // namespace

/// As many as there are targets at most, without zeros at the end.
std::vector<double> PoseImporter::fitted(const std::vector<double>& weights, std::size_t count,
                                         const std::string& pointer) {
  if (count != 0 && !weights.empty() && weights.size() != count) {
    context_.warn(pointer + "/weights", "are " + std::to_string(weights.size()) + " for " + std::to_string(count) +
                                            " morph targets; those that are missing are 0");
  }
  std::vector<double> out(weights.begin(),
                          weights.begin() + static_cast<std::ptrdiff_t>(std::min(count, weights.size())));
  while (!out.empty() && out.back() == 0.0) out.pop_back();
  return out;
}

const PoseImporter::Targets& PoseImporter::targetsOf(std::size_t mesh) {
  auto& known = targets_[mesh];
  if (known) return *known;
  known.emplace();
  const auto& source = context_.model.meshes[mesh];
  for (const auto& primitive : source.primitives) known->count = std::max(known->count, primitive.targets.size());
  known->weights = fitted(source.weights, known->count, "/meshes/" + std::to_string(mesh));
  return *known;
}

Pose PoseImporter::poseOf(const tinygltf::Node& node, const glm::dmat4& world, const std::string& pointer) {
  Pose pose;
  const auto& targets = targetsOf(static_cast<std::size_t>(node.mesh));
  if (targets.count != 0 && !node.weights.empty()) {
    auto weights = fitted(node.weights, targets.count, pointer);
    if (weights != targets.weights) pose.weights = std::move(weights);
  }
  pose.skin = node.skin;
  pose.mirrored = pose.skin >= 0 && glm::determinant(glm::dmat3(world)) < 0.0;
  return pose;
}

Result<bool> PoseImporter::apply(const Pose& pose, const tinygltf::Primitive& source, const std::string& pointer,
                                 Primitive& primitive) {
  const auto& weights = pose.weights ? *pose.weights : targetsOf(primitive.mesh).weights;
  if (!weights.empty() && !source.targets.empty()) {
    if (auto ok = morph(weights, source, pointer, primitive); !ok) return tl::unexpected(ok.error());
  }
  if (pose.skin < 0) return false;
  if (source.attributes.count("JOINTS_0") == 0 || source.attributes.count("WEIGHTS_0") == 0) {
    context_.warn(pointer, "has a skin, but no JOINTS_0 and WEIGHTS_0; it stays where its node is");
    return false;
  }
  const auto joints = jointMatrices(static_cast<std::size_t>(pose.skin));
  if (!joints) return tl::unexpected(joints.error());
  auto sets = influencesOf(context_, source, pointer);
  if (!sets) return tl::unexpected(sets.error());
  VertexSkin skin(context_, std::move(*sets), **joints);
  const auto before = primitive.positions;
  const glm::dvec3 side(pose.mirrored ? -1.0 : 1.0, 1.0, 1.0);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto matrix = skin.at(i);
    if (!matrix) return tl::unexpected(matrix.error());
    primitive.positions[i] = side * glm::dvec3(*matrix * glm::dvec4(before[i], 1.0));
    if (i >= primitive.normals.size()) continue;
    const auto turned = normalMatrix(*matrix) * glm::dvec3(primitive.normals[i]);
    const auto length = glm::length(turned);
    primitive.normals[i] = length > 0.0 ? glm::vec3(side * turned / length) : glm::vec3(0.0F);
  }
  if (skin.freeCount() != 0) {
    context_.warn(pointer + "/attributes/WEIGHTS_0",
                  std::to_string(skin.freeCount()) + " vertices have no weight; they follow the first joint they name");
  }
  if (auto ok = checkReach(before, primitive, "/skins/" + std::to_string(pose.skin)); !ok)
    return tl::unexpected(ok.error());
  return true;
}

Result<void> PoseImporter::checkReach(const std::vector<glm::dvec3>& before, const Primitive& primitive,
                                      const std::string& pointer) const {
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (isInRange(primitive.positions[i]) || !isInRange(before[i])) continue;
    return context_.bad(pointer, "moves vertex " + std::to_string(i) + " of /meshes/" + std::to_string(primitive.mesh) +
                                     "/primitives/" + std::to_string(primitive.primitive) +
                                     " to where no number reaches");
  }
  return {};
}

Result<void> PoseImporter::morph(const std::vector<double>& weights, const tinygltf::Primitive& source,
                                 const std::string& pointer, Primitive& primitive) {
  const auto before = primitive.positions;
  for (std::size_t t = 0; t < std::min(weights.size(), source.targets.size()); ++t) {
    if (weights[t] == 0.0) continue;
    for (const auto& [name, accessor] : source.targets[t]) {
      if (name != "POSITION" && name != "NORMAL") continue;
      const auto where = pointer + "/targets/" + std::to_string(t) + "/" + name;
      auto ok = addTarget(static_cast<std::size_t>(accessor), weights[t], where, primitive, name == "NORMAL");
      if (!ok) return ok;
    }
    const auto where = pointer + "/targets/" + std::to_string(t);
    if (auto ok = checkReach(before, primitive, where); !ok) return ok;
  }
  return {};
}

Result<void> PoseImporter::addTarget(std::size_t accessor, double weight, const std::string& pointer,
                                     Primitive& primitive, bool normals) {
  const auto reader = AccessorReader::open(context_.document, context_.model, accessor);
  if (!reader) return tl::unexpected(reader.error());
  const auto count = std::min(reader->size(), normals ? primitive.normals.size() : primitive.positions.size());
  if ((moved_ += count) / kMostTargets > context_.limits.max_vertices)
    return context_.tooLarge(pointer, "morph targets move too many vertices");
  for (std::size_t i = 0; i < count; ++i) {
    interruptionPoint();
    const auto v = reader->at(i);
    const auto delta = weight * glm::dvec3(v[0], v[1], v[2]);
    if (normals) {
      primitive.normals[i] += glm::vec3(delta);
    } else {
      primitive.positions[i] += delta;
    }
  }
  return {};
}

Result<const std::vector<glm::dmat4>*> PoseImporter::jointMatrices(std::size_t skin) {
  if (const auto found = joints_.find(skin); found != joints_.end()) return &found->second;
  if (worlds_.empty()) worlds_ = worldMatrices(context_.model);
  const auto& json = context_.document.gltf["skins"][skin];
  const auto pointer = "/skins/" + std::to_string(skin);
  std::optional<AccessorReader> bind;
  if (json.contains("inverseBindMatrices")) {
    auto reader =
        AccessorReader::open(context_.document, context_.model, json["inverseBindMatrices"].get<std::size_t>());
    if (!reader) return tl::unexpected(reader.error());
    bind = std::move(*reader);
  }
  std::vector<glm::dmat4> matrices;
  for (std::size_t j = 0; j < json["joints"].size(); ++j) {
    auto matrix = worlds_[json["joints"][j].get<std::size_t>()];
    if (bind) {
      glm::mat4 inverse(0.0F);
      if (const auto* bytes = bind->bytesAt(j)) std::memcpy(&inverse, bytes, sizeof inverse);
      matrix = matrix * glm::dmat4(inverse);
    }
    if (!isFinite(matrix)) return context_.bad(pointer + "/joints/" + std::to_string(j), "transform is not finite");
    matrices.push_back(matrix);
  }
  return &joints_.emplace(skin, std::move(matrices)).first->second;
}

}  // namespace radiosity::scene
