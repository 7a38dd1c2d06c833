// World to one face of a hemicube, or to a parallel projection of the whole scene. Every view is rendered at the same place of its own layer, so a shot's pixels do not
// depend on what else is in the batch.

layout(location = RAD_ATTRIBUTE_POSITION) in vec4 position_area;  // unit box; w: area of a leaf texel
layout(location = RAD_ATTRIBUTE_NORMAL) in vec3 normal;
layout(location = RAD_ATTRIBUTE_TEXEL) in vec2 texel;
layout(location = RAD_ATTRIBUTE_NODES) in uvec4 nodes;  // first node of front and back, level table, triangle

// The view, one for each draw (instance divisor 1). Attributes, since llvmpipe reads storage buffers lane by lane.
layout(location = RAD_ATTRIBUTE_VIEW) in vec4 view_right;       // clip.x; w: pixel's footprint at distance 1, times 4^bias
layout(location = RAD_ATTRIBUTE_VIEW + 1) in vec4 view_up;      // clip.y axis
layout(location = RAD_ATTRIBUTE_VIEW + 2) in vec4 view_depth;   // clip.w axis; w: layer
layout(location = RAD_ATTRIBUTE_VIEW + 3) in vec4 view_origin;  // shooter; w: level bias
#ifdef CULL_BELOW
layout(location = RAD_ATTRIBUTE_VIEW + 4) in vec4 view_normal;
// A triangle with all corners below is left out; what rises from below is clipped at the horizon.
out float gl_CullDistance[1];
#endif

#if defined(PAPER) || defined(SEE_THROUGH)
layout(location = RAD_ATTRIBUTE_SURFACE) in uint surface;
#endif
#ifdef SEE_THROUGH
out vec2 opacity_texel;
out vec4 opacity_toward;
flat out uvec2 opacity_surface_seed;
#endif

#ifdef SCATTER
layout(location = RAD_UNIFORM_ABSORBED_ID) uniform uint absorbed_id;
out vec2 chart_texel;
// First node of the side seen, level table, and as float bits the area of a pixel's footprint at z = 1 / texel area: one
// varying, since each costs setup time for every triangle.
flat out uvec3 node_level_footprint;
#elif defined(PAPER)
layout(location = RAD_UNIFORM_PATCH_BITS) uniform uint patch_bits;
layout(location = RAD_UNIFORM_TEXEL_TO_UV) uniform float texel_to_uv;
out vec2 patch_uv;
flat out uint polygon;  // in the high bits, as the paper's polygon colour
flat out float bias;
#else
flat out uint item;
#endif

void main() {
  vec3 d = position_area.xyz - view_origin.xyz;
#ifdef PARALLEL
  // w of right and up: shift of the image; the depth axis points towards the light
  gl_Position = vec4(dot(view_right.xyz, d) + view_right.w, dot(view_up.xyz, d) + view_up.w,
                     0.5 + dot(view_depth.xyz, d), 1.0);
#else
  gl_Position = vec4(dot(view_right.xyz, d), dot(view_up.xyz, d), RAD_NEAR, dot(view_depth.xyz, d));
#endif
  gl_Layer = int(view_depth.w);
#ifdef CULL_BELOW
  gl_CullDistance[0] = dot(view_normal.xyz, d) - RAD_COPLANAR;
#endif
#ifdef SEE_THROUGH
  // The view alone makes the seed, not its layer: a shot's pixels do not depend on what else is in the batch.
  uvec3 bits = floatBitsToUint(view_right.xyz) * uvec3(0x9E3779B1u, 0x85EBCA77u, 0xC2B2AE3Du);
  uvec3 place = floatBitsToUint(view_origin.xyz) * uvec3(0x27D4EB2Fu, 0x165667B1u, 0x9E3779B1u);
  opacity_texel = texel;
#ifdef PARALLEL
  vec3 toward = -view_depth.xyz;
#else
  vec3 toward = d;
#endif
  opacity_toward = vec4(toward, dot(normal, toward));
  opacity_surface_seed = uvec2(surface, bits.x ^ bits.y ^ bits.z ^ place.x ^ place.y ^ place.z);
#endif
#ifdef SCATTER
  float side = dot(normal, d);
  chart_texel = texel;
  uint first = side < 0.0 ? nodes.x : nodes.y;
  node_level_footprint = uvec3(first, first == absorbed_id ? RAD_ABSORBING_LEVELS : nodes.z,
                               floatBitsToUint(view_right.w / (abs(side) * position_area.w)));
#elif defined(PAPER)
  patch_uv = texel * texel_to_uv;
  polygon = (2u * surface + (dot(normal, d) < 0.0 ? 0u : 1u)) << patch_bits;
  // NEAREST_MIPMAP_NEAREST rounds where the formula takes the floor.
  bias = view_origin.w - 0.5;
#else
  item = nodes.w;
#endif
}
