#include "server/scene/patch_tree.h"

#include <utility>
#include <vector>

namespace radiosity::scene {

std::shared_ptr<const Bvh> treeOf(const PatchScene& patches) {
  std::vector<Bvh::Triangle> triangles(patches.triangles.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i)
    triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
  return std::make_shared<const Bvh>(std::move(triangles));
}

}  // namespace radiosity::scene
