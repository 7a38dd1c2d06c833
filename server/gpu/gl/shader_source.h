// The GLSL sources embedded at build time. Immutable; any thread.
#pragma once

namespace radiosity::gpu {

struct EmbeddedShader {
  const char* name;  ///< "hemicube.vert"; null ends the list
  const char* source;
};

extern const EmbeddedShader kEmbeddedShaders[];
extern const char* const kShaderConstants;  ///< shader_constants.h, put in front of every shader

}  // namespace radiosity::gpu
