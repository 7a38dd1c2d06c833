// Put in front of every fragment shader of the variant for scenes that one can see through in places. Coverage is by
// chance: a fragment of opacity a is there with probability a, by a hash of pixel, surface and view, so that the mean over
// pixels and shots is right and a shot can be replayed to the bit.

layout(std430, binding = RAD_BINDING_OPACITY_GRIDS) readonly buffer OpacityGrids {
  uvec4 opacity_grids[];  // by surface: first cell, width, height, cells across a leaf; 0 across: opaque
};
layout(std430, binding = RAD_BINDING_OPACITY) readonly buffer Opacity { uint opacity_words[]; };  // four cells each

in vec2 opacity_texel;
flat in uvec2 opacity_surface_seed;

uint mixBits(uint v) {  // finaliser of MurmurHash3
  v ^= v >> 16;
  v *= 0x85ebca6bu;
  v ^= v >> 13;
  v *= 0xc2b2ae35u;
  return v ^ (v >> 16);
}

void seeThrough() {
  uvec4 grid = opacity_grids[opacity_surface_seed.x];
  if (grid.w == 0u) return;
  uint x = min(uint(max(opacity_texel.x, 0.0) * float(grid.w)), grid.y - 1u);
  uint y = min(uint(max(opacity_texel.y, 0.0) * float(grid.w)), grid.z - 1u);
  uint cell = grid.x + y * grid.y + x;
  uint opacity = opacity_words[cell >> 2] >> (8u * (cell & 3u)) & 255u;
  if (opacity == 255u) return;
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  uint chance = mixBits(mixBits(mixBits(pixel.x | pixel.y << 16) ^ opacity_surface_seed.x) ^ opacity_surface_seed.y);
  if ((chance >> 8) * 255u >= (opacity << 24)) discard;
}
