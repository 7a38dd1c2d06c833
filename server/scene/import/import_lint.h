// Faults that do no harm to the light but that a file's author wants to hear of. Only warns. Any thread.
#pragma once

#include <string>
#include <vector>

#include "server/scene/import/import_context.h"
#include "server/scene/import/import_instancing.h"

namespace radiosity::scene {

/// Call last: what was not read because nothing places it is named too.
void warnAboutOddities(ImportContext& context);

/// Of EXT_mesh_gpu_instancing, while they are there; `pointer` is that of the extension's attributes.
void warnAboutElements(ImportContext& context, const std::vector<Trs>& elements, const std::string& pointer);

}  // namespace radiosity::scene
