// Names the patch whose size matches the pixel's footprint: a pixel of area p at distance 1 covers p z^3 / h of a plane at
// distance h from the shooter (z: depth along the face's axis), so level = floor(log2(footprint / texel area) / 2 + bias).

layout(std430, binding = RAD_BINDING_LEVELS) readonly buffer Levels { uvec2 levels[]; };  // offset, width | height << 16

in vec2 chart_texel;
flat in uvec3 node_level_footprint;
layout(location = 0) out uint node;

void main() {
#ifdef SEE_THROUGH
  seeThrough();
#endif
  uvec2 node_level = node_level_footprint.xy;
  float footprint = uintBitsToFloat(node_level_footprint.z);
  float z = 1.0 / gl_FragCoord.w;
  // floor(log2(f) / 2) is the halved exponent of the float: exact, and no logarithm.
  int exponent = int(floatBitsToUint(footprint * z * z * z) >> 23) - 127;
  int level = clamp(exponent >> 1, 0, int(node_level.y & RAD_LEVEL_MASK) - 1);
  uvec2 grid = levels[(node_level.y >> RAD_LEVEL_BITS) + uint(level)];
  uint width = grid.y & 0xFFFFu;
  uint x = min(uint(max(chart_texel.x, 0.0)) >> level, width - 1u);
  uint y = min(uint(max(chart_texel.y, 0.0)) >> level, (grid.y >> 16) - 1u);
  node = node_level.x + grid.x + y * width + x;
}
