// A step of the exporters: what a file says of textures that it does not have. Pure; any thread.
#pragma once

#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// Takes out of materials what refers to a texture that is not there, or whose image is not, and out of textures what
/// refers to an image or sampler that is not there: the importer does without them, but most viewers refuse the file.
void dropDanglingTextures(Json& gltf);

}  // namespace radiosity::scene
