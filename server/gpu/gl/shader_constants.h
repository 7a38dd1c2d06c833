// Constants shared by C++ and GLSL (this text is put in front of every shader), so the preprocessor's subset of both.
#ifndef RADIOSITY_SHADER_CONSTANTS_H
#define RADIOSITY_SHADER_CONSTANTS_H

// Faces of a hemicube: top, then sides in the directions +tangent, -tangent, +bitangent, -bitangent.
#define RAD_FACES 5

// Distance of the near plane in the unit box. Depth is reversed (1 at the near plane, 0 at infinity), so a plane this
// near costs no precision; it only keeps w away from zero. The shooter's own plane is culled, not clipped.
#define RAD_NEAR 1.0e-7

// A level-table reference is (first entry << RAD_LEVEL_BITS) | level count; entry 0 is a 1 x 1 grid that stands for
// sides that only absorb.
#define RAD_LEVEL_BITS 5
#define RAD_LEVEL_MASK 31u
#define RAD_ABSORBING_LEVELS 1u

// Heights above the shooter's plane (unit box) that are taken for the plane itself: rounding puts neighbours in the
// same plane up to 1e-7 above it, where they would cover everything.
#define RAD_COPLANAR 1.0e-6

// Item buffer and composed ids: a pixel that shows nothing.
#define RAD_ITEM_NONE 0xFFFFFFFFu

// Vertex attributes.
#define RAD_ATTRIBUTE_POSITION 0
#define RAD_ATTRIBUTE_NORMAL 1
#define RAD_ATTRIBUTE_TEXEL 2
#define RAD_ATTRIBUTE_NODES 3
#define RAD_ATTRIBUTE_SURFACE 4
#define RAD_ATTRIBUTE_VIEW 5  // five vec4

// Shader storage bindings.
#define RAD_BINDING_LEVELS 0
#define RAD_BINDING_OPACITY_GRIDS 1
#define RAD_BINDING_OPACITY 2

// Uniform locations.
#define RAD_UNIFORM_ABSORBED_ID 0
#define RAD_UNIFORM_PATCH_BITS 1
#define RAD_UNIFORM_TEXEL_TO_UV 2

#endif
