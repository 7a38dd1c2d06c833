// What glTF asks of a file beyond what a document needs to be understood here. Used by the exporters.
#pragma once

#include <cstddef>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// glTF wants a primitive's TEXCOORD_0, 1, ... without gaps: where a primitive lacks one below its highest it gets
/// zeros, which is what a lookup with a missing set gives. All such sets share one run of zeros at the end of `bytes`,
/// those of buffer `buffer`. Above TEXCOORD_15 gaps stay. kTooLarge: there is no room for the zeros.
[[nodiscard]] Result<void> fillTexcoordGaps(Json& gltf, std::size_t buffer, Bytes& bytes);

/// glTF allows `alphaCutoff` beside alphaMode MASK alone.
void dropIdleCutoffs(Json& gltf);

/// KHR_lights_punctual wants the inner angle of a spot below the outer, be it by one part in a million.
void separateCones(Json& gltf);

}  // namespace radiosity::scene
