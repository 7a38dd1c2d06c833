#include "server/scene/import/accessor.h"

#include <algorithm>
#include <cstring>

#include "server/scene/document/json_text.h"

namespace radiosity::scene {
namespace {

std::size_t componentBytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;  // INT and DOUBLE are tinygltf's own, not glTF's
  }
}

bool isIndexType(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

template <typename T>
T load(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

double loadNumber(const std::uint8_t* bytes, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return normalized ? std::max(load<std::int8_t>(bytes) / 127.0, -1.0) : load<std::int8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *bytes / (normalized ? 255.0 : 1.0);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return normalized ? std::max(load<std::int16_t>(bytes) / 32767.0, -1.0) : load<std::int16_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(bytes) / (normalized ? 65535.0 : 1.0);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return load<std::uint32_t>(bytes);
    default:
      return load<float>(bytes);
  }
}

std::uint32_t loadIndex(const std::uint8_t* bytes, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *bytes;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(bytes);
    default:
      return load<std::uint32_t>(bytes);
  }
}

const std::uint8_t* viewData(const Document& document, const tinygltf::BufferView& view, std::size_t offset) {
  return document.buffers[static_cast<std::size_t>(view.buffer)]->data() + view.byteOffset + offset;
}

/// Whether `count` elements from `offset` lie in the view. All terms are below 2^31 (schema), so nothing overflows.
bool fits(const tinygltf::BufferView& view, std::size_t offset, std::size_t count, std::size_t stride,
          std::size_t element) {
  return offset + (count - 1) * stride + element <= view.byteLength;
}

Result<void> checkSparse(const Document& document, const tinygltf::Model& model, const tinygltf::Accessor& accessor,
                         const std::string& pointer) {
  const auto& sparse = accessor.sparse;
  const auto bad = [&](const char* member, const char* what) {
    return fail(ErrorCode::kInvalidScene, what, place(document.name, pointer + "/sparse" + member));
  };
  const auto count = static_cast<std::size_t>(sparse.count);
  if (count > accessor.count) return bad("/count", "is more than the accessor's count");
  if (!isIndexType(sparse.indices.componentType))
    return bad("/indices/componentType", "must be an unsigned integer type");
  const auto* indices = viewOf(model, sparse.indices.bufferView);
  const auto* values = viewOf(model, sparse.values.bufferView);
  const auto index_bytes = componentBytes(sparse.indices.componentType);
  if (!fits(*indices, static_cast<std::size_t>(sparse.indices.byteOffset), count, index_bytes, index_bytes)) {
    return bad("/indices", "end past their buffer view");
  }
  const auto element = elementBytes(accessor);
  if (!fits(*values, static_cast<std::size_t>(sparse.values.byteOffset), count, element, element)) {
    return bad("/values", "end past their buffer view");
  }
  return {};
}

}  // namespace

std::size_t componentCount(const tinygltf::Accessor& accessor) {
  switch (accessor.type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
    case TINYGLTF_TYPE_MAT2:
      return 4;
    case TINYGLTF_TYPE_MAT3:
      return 9;
    default:
      return 16;
  }
}

std::size_t elementBytes(const tinygltf::Accessor& accessor) {
  const auto component = componentBytes(accessor.componentType);
  const auto column = [&](std::size_t rows) { return (rows * component + 3) / 4 * 4; };
  switch (accessor.type) {
    case TINYGLTF_TYPE_MAT2:
      return 2 * column(2);
    case TINYGLTF_TYPE_MAT3:
      return 3 * column(3);
    default:
      return componentCount(accessor) * component;
  }
}

Result<void> checkBufferView(const Document& document, const tinygltf::Model& model, std::size_t index) {
  const auto& view = model.bufferViews[index];
  const auto pointer = "/bufferViews/" + std::to_string(index);
  const auto size = document.buffers[static_cast<std::size_t>(view.buffer)]->size();
  if (view.byteOffset + view.byteLength > size) {
    return fail(ErrorCode::kInvalidScene,
                "ends at byte " + std::to_string(view.byteOffset + view.byteLength) + " of buffer " +
                    std::to_string(view.buffer) + ", which has " + std::to_string(size) +
                    (size == 0 ? " (no uri, and no BIN chunk for it)" : ""),
                place(document.name, pointer + "/byteLength"));
  }
  return {};
}

Result<void> checkAccessor(const Document& document, const tinygltf::Model& model, std::size_t index) {
  const auto& accessor = model.accessors[index];
  const auto pointer = "/accessors/" + std::to_string(index);
  if (componentBytes(accessor.componentType) == 0) {
    return fail(ErrorCode::kInvalidScene, "is not a component type of glTF: " + std::to_string(accessor.componentType),
                place(document.name, pointer + "/componentType"));
  }
  if (const auto* view = viewOf(model, accessor.bufferView)) {
    const auto element = elementBytes(accessor);
    const auto stride = view->byteStride == 0 ? element : view->byteStride;
    if (stride < element) {
      return fail(ErrorCode::kInvalidScene, "the buffer view's byteStride is less than an element",
                  place(document.name, pointer + "/bufferView"));
    }
    if (!fits(*view, accessor.byteOffset, accessor.count, stride, element)) {
      return fail(ErrorCode::kInvalidScene,
                  std::to_string(accessor.count) + " elements do not fit in buffer view " +
                      std::to_string(accessor.bufferView) + " of " + std::to_string(view->byteLength) + " bytes",
                  place(document.name, pointer + "/count"));
    }
  }
  return accessor.sparse.isSparse ? checkSparse(document, model, accessor, pointer) : Result<void>{};
}

Result<AccessorReader> AccessorReader::open(const Document& document, const tinygltf::Model& model, std::size_t index) {
  const auto& accessor = model.accessors[index];
  AccessorReader reader;
  reader.component_type_ = accessor.componentType;
  reader.normalized_ = accessor.normalized;
  reader.count_ = accessor.count;
  reader.components_ = componentCount(accessor);
  reader.element_bytes_ = elementBytes(accessor);
  if (const auto* view = viewOf(model, accessor.bufferView)) {
    reader.stride_ = view->byteStride == 0 ? reader.element_bytes_ : view->byteStride;
    reader.base_ = viewData(document, *view, accessor.byteOffset);
  }
  if (!accessor.sparse.isSparse) return reader;
  const auto& indices = accessor.sparse.indices;
  const auto* data =
      viewData(document, *viewOf(model, indices.bufferView), static_cast<std::size_t>(indices.byteOffset));
  const auto index_bytes = componentBytes(indices.componentType);
  for (std::size_t i = 0; i < static_cast<std::size_t>(accessor.sparse.count); ++i) {
    const auto value = loadIndex(data + i * index_bytes, indices.componentType);
    if (value >= accessor.count || (i > 0 && value <= reader.sparse_indices_.back())) {
      return fail(ErrorCode::kInvalidScene,
                  "sparse index " + std::to_string(i) + " is not increasing or not below count",
                  place(document.name, "/accessors/" + std::to_string(index) + "/sparse/indices"));
    }
    reader.sparse_indices_.push_back(value);
  }
  const auto& values = accessor.sparse.values;
  reader.sparse_base_ =
      viewData(document, *viewOf(model, values.bufferView), static_cast<std::size_t>(values.byteOffset));
  return reader;
}

const std::uint8_t* AccessorReader::bytesAt(std::size_t i) const {
  if (!sparse_indices_.empty()) {
    const auto found = std::lower_bound(sparse_indices_.begin(), sparse_indices_.end(), i);
    if (found != sparse_indices_.end() && *found == i) {
      return sparse_base_ + static_cast<std::size_t>(found - sparse_indices_.begin()) * element_bytes_;
    }
  }
  return base_ == nullptr ? nullptr : base_ + i * stride_;
}

std::array<double, 4> AccessorReader::at(std::size_t i) const {
  std::array<double, 4> out{};
  const auto* bytes = bytesAt(i);
  if (bytes == nullptr) return out;
  const auto step = componentBytes(component_type_);
  for (std::size_t c = 0; c < std::min(components_, out.size()); ++c)
    out[c] = loadNumber(bytes + c * step, component_type_, normalized_);
  return out;
}

std::uint32_t AccessorReader::indexAt(std::size_t i) const {
  const auto* bytes = bytesAt(i);
  return bytes == nullptr ? 0 : loadIndex(bytes, component_type_);
}

}  // namespace radiosity::scene
