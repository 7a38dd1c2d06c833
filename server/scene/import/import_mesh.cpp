#include "server/scene/import/import_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <string>
#include <unordered_map>
#include <unordered_set>

#include "common/task.h"
#include "server/scene/import/accessor.h"
#include "server/scene/import/import_normals.h"

namespace radiosity::scene {
namespace {

bool isFinite(const glm::dvec3& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

/// Strips and fans to lists; the winding of every other strip triangle is turned (glTF 2.0, 3.7.2.1).
std::vector<std::uint32_t> toTriangleList(const std::vector<std::uint32_t>& in, int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) return {in.begin(), in.end() - static_cast<std::ptrdiff_t>(in.size() % 3)};
  std::vector<std::uint32_t> out;
  for (std::size_t i = 2; i < in.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      out.insert(out.end(), {in[i - 1], in[i], in[0]});
    } else if (i % 2 == 0) {
      out.insert(out.end(), {in[i - 2], in[i - 1], in[i]});
    } else {
      out.insert(out.end(), {in[i - 2], in[i], in[i - 1]});
    }
  }
  return out;
}

bool hasArea(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const auto u = b - a;
  const auto v = c - a;
  const auto w = c - b;
  const auto longest = std::max({glm::dot(u, u), glm::dot(v, v), glm::dot(w, w)});
  // Positions come from 32-bit floats: a sliver thinner than 1e-10 of its length is rounding of a line.
  return glm::length(glm::cross(u, v)) > 1e-10 * longest;
}

struct PositionHash {
  std::size_t operator()(const glm::dvec3& p) const {
    const std::hash<double> hash;
    return hash(p.x) ^ (hash(p.y) * 0x9E3779B97F4A7C15U) ^ (hash(p.z) * 0xC2B2AE3D27D4EB4FU);
  }
};

struct TriangleHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& t) const {
    return (t[0] * 0x9E3779B97F4A7C15U) ^ (t[1] * 0xC2B2AE3D27D4EB4FU) ^ (t[2] * 0x165667B19E3779F9U);
  }
};

/// Leaves out triangles without area, with corners that are not finite, and exact copies that face the same way.
/// Returns how many were dropped.
std::uint64_t dropBadTriangles(Primitive& primitive) {
  std::unordered_map<glm::dvec3, std::uint32_t, PositionHash> ids;
  std::unordered_set<std::array<std::uint32_t, 3>, TriangleHash> seen;
  std::vector<std::uint32_t> kept;
  const auto id = [&](std::uint32_t vertex) {
    return ids.try_emplace(primitive.positions[vertex], static_cast<std::uint32_t>(ids.size())).first->second;
  };
  for (std::size_t i = 0; i < primitive.indices.size(); i += 3) {
    interruptionPoint();
    const auto* t = &primitive.indices[i];
    const auto& a = primitive.positions[t[0]];
    const auto& b = primitive.positions[t[1]];
    const auto& c = primitive.positions[t[2]];
    if (!isFinite(a) || !isFinite(b) || !isFinite(c) || !hasArea(a, b, c)) continue;
    std::array<std::uint32_t, 3> key = {id(t[0]), id(t[1]), id(t[2])};
    std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());  // same cycle, same facing
    if (seen.insert(key).second) kept.insert(kept.end(), t, t + 3);
  }
  const auto dropped = (primitive.indices.size() - kept.size()) / 3;
  primitive.indices = std::move(kept);
  return dropped;
}

float finiteOr(double value, float otherwise) {
  const auto x = static_cast<float>(value);
  return std::isfinite(x) ? x : otherwise;
}

}  // namespace

Result<std::vector<MeshImporter::Posed>> MeshImporter::primitivesOf(const tinygltf::Node& node, const glm::dmat4& world,
                                                                    const std::string& pointer, bool skinned) {
  auto pose = poses_.poseOf(node, world, pointer);
  if (!skinned) {
    pose.skin = -1;
    pose.mirrored = false;
  }
  auto found = done_.find({node.mesh, pose});
  if (found == done_.end()) {
    std::vector<Imported> all;
    const auto mesh = static_cast<std::size_t>(node.mesh);
    for (std::size_t p = 0; p < context_.model.meshes[mesh].primitives.size(); ++p) {
      const auto imported = importPrimitive(mesh, p, pose);
      if (!imported) return tl::unexpected(imported.error());
      if (*imported) all.push_back(**imported);
    }
    found = done_.emplace(std::pair{node.mesh, pose}, std::move(all)).first;
  }
  std::vector<Posed> out;
  glm::dmat4 joined(1.0);
  if (pose.mirrored) joined[0][0] = -1.0;
  for (const auto& one : found->second) out.push_back({one.primitive, one.skinned ? joined : world});
  return out;
}

Result<std::optional<MeshImporter::Imported>> MeshImporter::importPrimitive(std::size_t mesh, std::size_t index,
                                                                            const Pose& pose) {
  const auto pointer = "/meshes/" + std::to_string(mesh) + "/primitives/" + std::to_string(index);
  const auto& source = context_.model.meshes[mesh].primitives[index];
  if (source.mode < TINYGLTF_MODE_TRIANGLES) {
    context_.warn(pointer, "points and lines have no area; skipped");
    return std::nullopt;
  }
  if (source.attributes.count("POSITION") == 0) {
    context_.warn(pointer, "has no POSITION; skipped");
    return std::nullopt;
  }
  Primitive primitive;
  primitive.mesh = static_cast<std::uint32_t>(mesh);
  primitive.primitive = static_cast<std::uint32_t>(index);
  if (auto ok = readVertices(source, primitive, pointer); !ok) return tl::unexpected(ok.error());
  const auto skinned = poses_.apply(pose, source, pointer, primitive);
  if (!skinned) return tl::unexpected(skinned.error());
  primitive.posed = *skinned || !source.targets.empty();
  if (auto ok = readTriangles(source, primitive, pointer); !ok) return tl::unexpected(ok.error());
  if (primitive.indices.empty()) {
    context_.warn(pointer, "has no triangles with area; skipped");
    return std::nullopt;
  }
  if (const auto faults = settleNormals(primitive); faults.count() != 0)
    context_.warn(pointer + "/attributes/NORMAL", faults.text(primitive.positions.size()));
  primitive.material = materialOf(source);
  context_.scene.primitives.push_back(std::move(primitive));
  return Imported{static_cast<std::uint32_t>(context_.scene.primitives.size() - 1), *skinned};
}

Result<void> MeshImporter::readVertices(const tinygltf::Primitive& source, Primitive& primitive,
                                        const std::string& pointer) {
  for (const auto& [name, accessor] : source.attributes) {
    const bool position = name == "POSITION";
    const bool color = name == "COLOR_0";
    if (!position && !color && name != "TEXCOORD_0" && name != "TEXCOORD_1") continue;
    const auto reader = AccessorReader::open(context_.document, context_.model, static_cast<std::size_t>(accessor));
    if (!reader) return tl::unexpected(reader.error());
    // Many primitives may share one accessor: what counts is what we hold.
    if (position && (vertices_ += reader->size()) > context_.limits.max_vertices) {
      return context_.tooLarge(pointer, "more than " + std::to_string(context_.limits.max_vertices) + " vertices");
    }
    for (std::size_t i = 0; i < reader->size(); ++i) {
      interruptionPoint();
      const auto v = reader->at(i);
      if (position) primitive.positions.emplace_back(v[0], v[1], v[2]);
      if (name == "TEXCOORD_0") primitive.texcoord0.emplace_back(finiteOr(v[0], 0), finiteOr(v[1], 0));
      if (name == "TEXCOORD_1") primitive.texcoord1.emplace_back(finiteOr(v[0], 0), finiteOr(v[1], 0));
      if (!color) continue;
      const auto alpha = reader->components() == 4 ? finiteOr(v[3], 1) : 1.0F;
      primitive.color0.emplace_back(std::max(finiteOr(v[0], 1), 0.0F), std::max(finiteOr(v[1], 1), 0.0F),
                                    std::max(finiteOr(v[2], 1), 0.0F), std::clamp(alpha, 0.0F, 1.0F));
    }
  }
  return readNormals(source, primitive);
}

/// As they stand in the file: of them there may be more or fewer than vertices.
Result<void> MeshImporter::readNormals(const tinygltf::Primitive& source, Primitive& primitive) {
  const auto found = source.attributes.find("NORMAL");
  if (found == source.attributes.end()) return {};
  const auto reader = AccessorReader::open(context_.document, context_.model, static_cast<std::size_t>(found->second));
  if (!reader) return tl::unexpected(reader.error());
  const auto count = std::min(reader->size(), primitive.positions.size());
  primitive.normals.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    interruptionPoint();
    const auto v = reader->at(i);
    primitive.normals.emplace_back(v[0], v[1], v[2]);
  }
  return {};
}

Result<void> MeshImporter::readTriangles(const tinygltf::Primitive& source, Primitive& primitive,
                                         const std::string& pointer) {
  std::vector<std::uint32_t> indices;
  if (source.indices < 0) {
    indices.resize(primitive.positions.size());
    for (std::size_t i = 0; i < indices.size(); ++i) indices[i] = static_cast<std::uint32_t>(i);
  } else {
    const auto accessor = static_cast<std::size_t>(source.indices);
    const auto reader = AccessorReader::open(context_.document, context_.model, accessor);
    if (!reader) return tl::unexpected(reader.error());
    for (std::size_t i = 0; i < reader->size(); ++i) {
      interruptionPoint();
      indices.push_back(reader->indexAt(i));
      if (indices.back() < primitive.positions.size()) continue;
      return context_.bad("/accessors/" + std::to_string(accessor),
                          "index " + std::to_string(i) + " is " + std::to_string(indices.back()) + ", but " + pointer +
                              " has " + std::to_string(primitive.positions.size()) + " vertices");
    }
  }
  if (source.mode == TINYGLTF_MODE_TRIANGLES && indices.size() % 3 != 0) {
    context_.warn(pointer, "number of corners is not a multiple of 3; the rest is ignored");
  }
  primitive.indices = toTriangleList(indices, source.mode);
  const auto dropped = dropBadTriangles(primitive);
  if (dropped != 0) {
    context_.scene.triangles_dropped += dropped;
    context_.warn(pointer, std::to_string(dropped) + " triangles without area, not finite or doubled are left out");
  }
  // No triangle uses these any more; nobody downstream need care.
  for (auto& p : primitive.positions) {
    if (!isFinite(p)) p = glm::dvec3(0.0);
  }
  return {};
}

std::uint32_t MeshImporter::materialOf(const tinygltf::Primitive& source) {
  if (source.material >= 0) return static_cast<std::uint32_t>(source.material);
  if (default_material_ == kNone) {
    // glTF's default material is fully metallic, which reflects nothing diffusely; a mesh that names no material is
    // meant to be seen, so ours is white and not metallic.
    default_material_ = static_cast<std::uint32_t>(context_.scene.materials.size());
    context_.scene.materials.emplace_back().name = "(default)";
  }
  return default_material_;
}

}  // namespace radiosity::scene
