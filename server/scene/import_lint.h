// Faults that do no harm to the light but that a file's author wants to hear of. Only warns. Any thread.
#pragma once

#include "server/scene/import_context.h"

namespace radiosity::scene {

/// Call last: what was not read because nothing places it is named too.
void warnAboutOddities(ImportContext& context);

}  // namespace radiosity::scene
