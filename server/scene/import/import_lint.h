// Faults that do no harm to the light but that a file's author wants to hear of. Only warns. Any thread.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "server/scene/import/import_context.h"
#include "server/scene/import/import_instancing.h"

namespace radiosity::scene {

/// Names of all that a document uses, but for what its materials do.
[[nodiscard]] std::set<std::string> extensionsBesideMaterials(const Json& gltf);

/// Call last: what was not read because nothing places it is named too. `extensions`: as above.
void warnAboutOddities(ImportContext& context, std::set<std::string> extensions);

/// Of EXT_mesh_gpu_instancing, while they are there; `pointer` is that of the extension's attributes.
void warnAboutElements(ImportContext& context, const std::vector<Trs>& elements, const std::string& pointer);

}  // namespace radiosity::scene
