#include "server/scene/import/import_instancing.h"

#include <array>
#include <glm/gtc/matrix_transform.hpp>
#include <optional>

#include "common/task.h"
#include "server/scene/import/accessor.h"

namespace radiosity::scene {

glm::dmat4 Trs::matrix() const {
  return glm::translate(glm::dmat4(1.0), translation) * glm::mat4_cast(rotation) * glm::scale(glm::dmat4(1.0), scale);
}

Result<std::vector<Trs>> readInstancing(const Document& document, const tinygltf::Model& model, const Json& attributes,
                                        const std::string& pointer) {
  constexpr std::array<const char*, 3> kNames = {"TRANSLATION", "ROTATION", "SCALE"};
  std::array<std::optional<AccessorReader>, 3> readers;
  std::optional<std::size_t> count;
  for (std::size_t k = 0; k < kNames.size(); ++k) {
    if (!attributes.contains(kNames[k])) continue;
    const auto where = place(document.name, pointer + "/" + kNames[k]);
    const auto accessor = attributes[kNames[k]].get<std::size_t>();
    if (model.accessors[accessor].type != (k == 1 ? TINYGLTF_TYPE_VEC4 : TINYGLTF_TYPE_VEC3)) {
      return fail(ErrorCode::kInvalidScene, "accessor has the wrong type", where);
    }
    auto reader = AccessorReader::open(document, model, accessor);
    if (!reader) return tl::unexpected(reader.error());
    if (count && *count != reader->size()) return fail(ErrorCode::kInvalidScene, "attributes differ in count", where);
    count = reader->size();
    readers[k] = std::move(*reader);
  }
  if (!count) {
    return fail(ErrorCode::kInvalidScene, "has none of TRANSLATION, ROTATION and SCALE", place(document.name, pointer));
  }
  std::vector<Trs> out(*count);
  for (std::size_t i = 0; i < *count; ++i) {
    interruptionPoint();
    const auto vec3 = [&](std::size_t k) {
      const auto v = readers[k]->at(i);
      return glm::dvec3(v[0], v[1], v[2]);
    };
    if (readers[0]) out[i].translation = vec3(0);
    if (readers[2]) out[i].scale = vec3(2);
    if (!readers[1]) continue;
    const auto q = readers[1]->at(i);
    out[i].rotation = glm::normalize(glm::dquat(q[3], q[0], q[1], q[2]));  // of zero length: identity
  }
  return out;
}

}  // namespace radiosity::scene
