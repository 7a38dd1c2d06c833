// What a document claims to hold, summed up before anything of it is made: a few hundred bytes of JSON can name
// gigabytes. Pure functions of values; any thread.
#pragma once

#include <cstdint>

#include "server/scene/document/document.h"
#include "server/scene/import/import_model.h"

namespace radiosity::scene {

/// Bytes that the geometry of the scene to show takes, about: vertices of each primitive in each pose, placed triangles
/// and instances, in the server and in each renderer, elements of EXT_mesh_gpu_instancing. `claimed`: what the JSON
/// takes. kTooLarge, naming the primitive or the node at fault: all is more than the limit, or than is likely of so few
/// bytes of data where no limit is named, or there are more instances than ImportLimits::max_nodes. Needs a checked
/// model. O(nodes + primitives, log of the poses).
[[nodiscard]] Result<std::uint64_t> claimOfGeometry(const Document& document, const tinygltf::Model& model,
                                                    std::uint64_t claimed, const ImportLimits& limits);

}  // namespace radiosity::scene
