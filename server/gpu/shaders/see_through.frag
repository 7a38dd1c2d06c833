// Put in front of every fragment shader of the variant for scenes that one can see through in places. Coverage is by
// chance: a fragment of opacity a is there with probability a, by a hash of pixel, surface and view, so that the mean over
// pixels and shots is right and a shot can be replayed to the bit.

layout(std430, binding = RAD_BINDING_OPACITY_GRIDS) readonly buffer OpacityGrids {
  // By surface: first cell, width, height, and in the last word bits 0 to 15: cells across a leaf, 0: opaque; bits 16 to
  // 31, of glass: reflectance for light straight at it, times 65535.
  uvec4 opacity_grids[];
};
layout(std430, binding = RAD_BINDING_OPACITY) readonly buffer Opacity { uint opacity_words[]; };  // four cells each

in vec2 opacity_texel;
flat in uvec2 opacity_surface_seed;
in vec4 opacity_toward;  // from the eye to the place; w: along the normal

uint mixBits(uint v) {  // finaliser of MurmurHash3
  v ^= v >> 16;
  v *= 0x85ebca6bu;
  v ^= v >> 13;
  v *= 0xc2b2ae35u;
  return v ^ (v >> 16);
}

void seeThrough() {
  uvec4 grid = opacity_grids[opacity_surface_seed.x];
  uint across = grid.w & 65535u;
  if (across == 0u) return;
  uint x = min(uint(max(opacity_texel.x, 0.0) * float(across)), grid.y - 1u);
  uint y = min(uint(max(opacity_texel.y, 0.0) * float(across)), grid.z - 1u);
  uint cell = grid.x + y * grid.y + x;
  uint opacity = opacity_words[cell >> 2] >> (8u * (cell & 3u)) & 255u;
  if (opacity == 255u) return;
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  uint chance = mixBits(mixBits(mixBits(pixel.x | pixel.y << 16) ^ opacity_surface_seed.x) ^ opacity_surface_seed.y);
  if (grid.w < 65536u) {
    if ((chance >> 8) * 255u >= (opacity << 24)) discard;
    return;
  }
  // scene::GlassFace::stopped(): Fresnel's law by Schlick, (1 - R) / (1 - R straight on) = 1 - (1 - cos)^5.
  float edge = pow(clamp(1.0 - abs(opacity_toward.w) / length(opacity_toward.xyz), 0.0, 1.0), 5.0);
  float passes = (1.0 - float(opacity) / 255.0) * (1.0 - edge);
  if (float(chance >> 8) >= (1.0 - passes) * 16777216.0) discard;
}
