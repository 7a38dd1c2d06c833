#include "server/scene/lightmap/lit_glb_made.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

namespace radiosity::scene {
namespace {

template <typename Component>
double storeAs(double value, std::uint8_t* bytes) {
  Component stored{};
  if constexpr (std::numeric_limits<Component>::is_integer) {
    constexpr auto kLow = static_cast<double>(std::numeric_limits<Component>::min());
    constexpr auto kHigh = static_cast<double>(std::numeric_limits<Component>::max());
    stored = static_cast<Component>(std::clamp(std::round(value), kLow, kHigh));
  } else {
    stored = static_cast<Component>(value);
  }
  std::memcpy(bytes, &stored, sizeof stored);
  return static_cast<double>(stored);
}

double store(double value, int component_type, std::uint8_t* bytes) {
  switch (component_type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return storeAs<std::int8_t>(value, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return storeAs<std::uint8_t>(value, bytes);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return storeAs<std::int16_t>(value, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return storeAs<std::uint16_t>(value, bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return storeAs<std::uint32_t>(value, bytes);
    default:
      return storeAs<float>(value, bytes);
  }
}

/// Of a direction that is stored in integers, their largest is 1.
double unitOf(int component_type) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_BYTE) return 127.0;
  return component_type == TINYGLTF_COMPONENT_TYPE_SHORT ? 32767.0 : 1.0;
}

}  // namespace

MadeElement madeElement(const AccessorReader& reader, const tinygltf::Accessor& accessor, const MadeVertex& vertex,
                        MadeHow how) {
  const auto components = componentCount(accessor);
  const auto nearest = static_cast<std::size_t>(std::ranges::max_element(vertex.weight) - vertex.weight.begin());
  const auto plain = reader.unnormalized();
  MadeElement made;
  made.bytes.resize(elementBytes(accessor), 0);
  const bool is_vector =
      accessor.type != TINYGLTF_TYPE_MAT2 && components <= made.stored.size() && how != MadeHow::kNearest;
  if (!is_vector) {
    if (const auto* bytes = reader.bytesAt(vertex.of[nearest]))
      std::copy_n(bytes, made.bytes.size(), made.bytes.data());
    return made;
  }
  std::array<double, 4> sum{};
  for (std::size_t k = 0; k < vertex.of.size(); ++k) {
    const auto value = plain.at(vertex.of[k]);
    for (std::size_t c = 0; c < components; ++c) sum[c] += vertex.weight[k] * value[c];
  }
  if (how == MadeHow::kUnitLength) {
    const double length = std::hypot(sum[0], sum[1], sum[2]);
    if (length > 0.0)
      for (std::size_t c = 0; c < 3; ++c) sum[c] *= unitOf(accessor.componentType) / length;
    if (components == 4) sum[3] = plain.at(vertex.of[nearest])[3];  // a tangent's handedness
  }
  const auto step = made.bytes.size() / components;
  for (std::size_t c = 0; c < components; ++c)
    made.stored[c] = store(sum[c], accessor.componentType, made.bytes.data() + c * step);
  return made;
}

}  // namespace radiosity::scene
