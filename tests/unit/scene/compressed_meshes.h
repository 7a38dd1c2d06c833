// Meshes compressed by the libraries' own encoders, and documents that hold them, for tests.
#pragma once

#include <draco/compression/encode.h>
#include <draco/mesh/mesh.h>
#include <meshoptimizer.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {

/// A square of so many cells along each side, in XY, slightly bent.
struct Grid {
  explicit Grid(std::uint32_t side) {
    const auto step = 1.0F / static_cast<float>(side);
    for (std::uint32_t y = 0; y <= side; ++y)
      for (std::uint32_t x = 0; x <= side; ++x) {
        const auto u = static_cast<float>(x) * step, v = static_cast<float>(y) * step;
        positions.insert(positions.end(), {u, v, 0.25F * u * v});
        uvs.insert(uvs.end(), {u, v});
      }
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        const auto a = y * (side + 1) + x, b = a + side + 1;
        indices.insert(indices.end(), {a, a + 1, b + 1, a, b + 1, b});
      }
  }
  [[nodiscard]] std::size_t points() const { return positions.size() / 3; }

  std::vector<float> positions, uvs;
  std::vector<std::uint32_t> indices;
};

template <typename T>
std::uint32_t addDracoAttribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, draco::DataType data_type,
                                std::uint8_t components, const std::vector<T>& values) {
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, components, data_type, false, static_cast<std::int64_t>(components * sizeof(T)), 0);
  const auto id = mesh.AddAttribute(attribute, true, mesh.num_points());
  for (std::uint32_t p = 0; p < mesh.num_points(); ++p)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(p), &values[p * components]);
  return mesh.attribute(id)->unique_id();
}

struct DracoOptions {
  int method = draco::MESH_EDGEBREAKER_ENCODING;
  int speed = 3;
};

/// POSITION is attribute 0, TEXCOORD_0 is 1, and _ID, 16 bits wide, is 2.
inline Bytes dracoStream(const Grid& grid, const DracoOptions& options = {}) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(grid.points()));
  for (std::size_t i = 0; i < grid.indices.size(); i += 3) {
    draco::Mesh::Face face;
    for (std::size_t c = 0; c < 3; ++c) face[c] = draco::PointIndex(grid.indices[i + c]);
    mesh.AddFace(face);
  }
  std::vector<std::uint16_t> ids(grid.points());
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<std::uint16_t>(i % 200);
  addDracoAttribute(mesh, draco::GeometryAttribute::POSITION, draco::DT_FLOAT32, 3, grid.positions);
  addDracoAttribute(mesh, draco::GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, 2, grid.uvs);
  addDracoAttribute(mesh, draco::GeometryAttribute::GENERIC, draco::DT_UINT16, 1, ids);
  draco::Encoder encoder;
  encoder.SetSpeedOptions(options.speed, options.speed);
  encoder.SetEncodingMethod(options.method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::TEX_COORD, 12);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeMeshToBuffer(mesh, &buffer).ok()) return {};
  const auto* first = reinterpret_cast<const std::uint8_t*>(buffer.data());
  return {first, first + buffer.size()};
}

/// Puts bytes into the builder's buffer; returns their view.
inline std::size_t addView(GltfBuilder& builder, const Bytes& bytes) {
  while (builder.bin.size() % 4 != 0) builder.bin.push_back(0);
  const auto first = builder.bin.size();
  builder.bin.insert(builder.bin.end(), bytes.begin(), bytes.end());
  builder.gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", first}, {"byteLength", bytes.size()}});
  return builder.gltf["bufferViews"].size() - 1;
}

inline std::size_t declare(GltfBuilder& builder, std::size_t count, int component_type, const char* type) {
  builder.gltf["accessors"].push_back({{"count", count}, {"componentType", component_type}, {"type", type}});
  return builder.gltf["accessors"].size() - 1;
}

inline void require(GltfBuilder& builder, const std::string& extension) {
  for (const auto* list : {"extensionsUsed", "extensionsRequired"}) builder.gltf[list].push_back(extension);
}

/// A mesh of a Draco stream as dracoStream() makes it of a grid; returns it.
inline std::size_t addDracoMesh(GltfBuilder& builder, const Bytes& stream, const Grid& grid) {
  const Json attributes = {{"POSITION", declare(builder, grid.points(), 5126, "VEC3")},
                           {"TEXCOORD_0", declare(builder, grid.points(), 5126, "VEC2")},
                           {"_ID", declare(builder, grid.points(), 5121, "SCALAR")}};
  const auto indices = declare(builder, grid.indices.size(), 5123, "SCALAR");
  const Json draco = {{"bufferView", addView(builder, stream)},
                      {"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}, {"_ID", 2}}}};
  builder.gltf["meshes"].push_back({{"primitives",
                                     {{{"attributes", attributes},
                                       {"indices", indices},
                                       {"extensions", {{"KHR_draco_mesh_compression", draco}}}}}}});
  return builder.gltf["meshes"].size() - 1;
}

/// A document that shows nothing but a grid, compressed by Draco.
inline GltfBuilder dracoDocument(const Grid& grid, const Bytes& stream) {
  GltfBuilder builder;
  builder.node({{"mesh", addDracoMesh(builder, stream, grid)}});
  require(builder, "KHR_draco_mesh_compression");
  return builder;
}

inline Bytes meshoptAttributes(const Bytes& elements, std::size_t count) {
  const auto stride = elements.size() / count;
  Bytes stream(meshopt_encodeVertexBufferBound(count, stride));
  stream.resize(meshopt_encodeVertexBuffer(stream.data(), stream.size(), elements.data(), count, stride));
  return stream;
}

inline Bytes meshoptIndices(const std::vector<std::uint32_t>& indices, std::size_t points, bool triangles) {
  const auto* corners = indices.data();
  Bytes stream(triangles ? meshopt_encodeIndexBufferBound(indices.size(), points)
                         : meshopt_encodeIndexSequenceBound(indices.size(), points));
  stream.resize(triangles ? meshopt_encodeIndexBuffer(stream.data(), stream.size(), corners, indices.size())
                          : meshopt_encodeIndexSequence(stream.data(), stream.size(), corners, indices.size()));
  return stream;
}

/// Documents whose views are compressed by meshoptimizer, with a fallback buffer that has no data.
class MeshoptBuilder {
 public:
  explicit MeshoptBuilder(std::string extension) : extension_(std::move(extension)) {}

  /// Elements as the filter's encoder left them; returns their view.
  std::size_t attributes(const Bytes& elements, std::size_t count, const char* filter = "NONE") {
    const auto stride = elements.size() / count;
    return view(meshoptAttributes(elements, count),
                {{"mode", "ATTRIBUTES"}, {"filter", filter}, {"count", count}, {"byteStride", stride}});
  }

  /// `width`: bytes of an index.
  std::size_t indices(const std::vector<std::uint32_t>& indices, std::size_t points, const std::string& mode,
                      std::size_t width) {
    return view(meshoptIndices(indices, points, mode == "TRIANGLES"),
                {{"mode", mode}, {"count", indices.size()}, {"byteStride", width}});
  }

  /// Shows a grid.
  GltfBuilder mesh(const Grid& grid, const std::string& mode = "TRIANGLES", std::size_t width = 2) {
    Bytes positions(grid.positions.size() * sizeof(float));
    std::memcpy(positions.data(), grid.positions.data(), positions.size());
    const auto accessor = [&](std::size_t view, std::size_t count, int component_type, const char* type) {
      const auto index = declare(builder_, count, component_type, type);
      builder_.gltf["accessors"][index]["bufferView"] = view;
      return index;
    };
    const auto position = accessor(attributes(positions, grid.points()), grid.points(), 5126, "VEC3");
    const auto index = accessor(indices(grid.indices, grid.points(), mode, width), grid.indices.size(),
                                width == 2 ? 5123 : 5125, "SCALAR");
    builder_.gltf["meshes"].push_back(
        {{"primitives", {{{"attributes", {{"POSITION", position}}}, {"indices", index}}}}});
    builder_.node({{"mesh", 0}});
    return finish();
  }

  GltfBuilder finish() {
    require(builder_, extension_);
    builder_.extra_buffers.push_back(
        {{"byteLength", fallback_bytes_}, {"extensions", {{extension_, {{"fallback", true}}}}}});
    return builder_;
  }

 private:
  std::size_t view(const Bytes& stream, Json form) {
    const auto index = addView(builder_, stream);
    auto& view = builder_.gltf["bufferViews"][index];
    form.update(view);
    const auto bytes = form["count"].get<std::size_t>() * form["byteStride"].get<std::size_t>();
    view = {
        {"buffer", 1}, {"byteOffset", fallback_bytes_}, {"byteLength", bytes}, {"extensions", {{extension_, form}}}};
    fallback_bytes_ += (bytes + 3) / 4 * 4;
    return index;
  }

  std::string extension_;
  GltfBuilder builder_;
  std::size_t fallback_bytes_ = 0;
};

}  // namespace radiosity::scene::test
