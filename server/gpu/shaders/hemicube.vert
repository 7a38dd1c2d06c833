// World to one face of a hemicube. Every view is rendered at the same place of its own layer, so a shot's pixels do not
// depend on what else is in the batch.

layout(location = RAD_ATTRIBUTE_POSITION) in vec4 position_area;  // unit box; w: area of a leaf texel
layout(location = RAD_ATTRIBUTE_NORMAL) in vec3 normal;
layout(location = RAD_ATTRIBUTE_TEXEL) in vec2 texel;
layout(location = RAD_ATTRIBUTE_NODES) in uvec4 nodes;  // first node of front and back, level table, triangle
layout(location = RAD_ATTRIBUTE_VIEW) in uint view;     // one for each draw (instance divisor 1)

struct View {
  vec4 right;   // clip.x axis, subpixel offset included; w: footprint of a pixel at distance 1, times 4^bias
  vec4 up;      // clip.y axis, subpixel offset included; w: face
  vec4 depth;   // clip.w axis; w: layer
  vec4 origin;  // shooter; w: level bias
};
layout(std430, binding = RAD_BINDING_VIEWS) readonly buffer Views { View views[]; };

#ifdef SCATTER
layout(location = RAD_UNIFORM_ABSORBED_ID) uniform uint absorbed_id;
out vec2 chart_texel;
flat out float footprint;   // area of a pixel's footprint / texel area = footprint x z^3
flat out uvec2 node_level;  // first node of the side seen, level table
#elif defined(PAPER)
layout(location = RAD_ATTRIBUTE_SURFACE) in uint surface;
layout(location = RAD_UNIFORM_PATCH_BITS) uniform uint patch_bits;
layout(location = RAD_UNIFORM_TEXEL_TO_UV) uniform float texel_to_uv;
out vec2 patch_uv;
flat out uint polygon;  // in the high bits, as the paper's polygon colour
flat out float bias;
#else
flat out uint item;
#endif

void main() {
  View v = views[view];
  vec3 d = position_area.xyz - v.origin.xyz;
  gl_Position = vec4(dot(v.right.xyz, d), dot(v.up.xyz, d), RAD_NEAR, dot(v.depth.xyz, d));
  gl_ViewportIndex = int(v.up.w);
  gl_Layer = int(v.depth.w);
#ifdef SCATTER
  float side = dot(normal, d);
  chart_texel = texel;
  footprint = v.right.w / (abs(side) * position_area.w);
  uint first = side < 0.0 ? nodes.x : nodes.y;
  node_level = uvec2(first, first == absorbed_id ? RAD_ABSORBING_LEVELS : nodes.z);
#elif defined(PAPER)
  patch_uv = texel * texel_to_uv;
  polygon = (2u * surface + (dot(normal, d) < 0.0 ? 0u : 1u)) << patch_bits;
  // NEAREST_MIPMAP_NEAREST rounds where the formula takes the floor.
  bias = v.origin.w - 0.5;
#else
  item = nodes.w;
#endif
}
