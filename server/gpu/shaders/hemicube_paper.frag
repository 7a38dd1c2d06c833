// Lum, Ma and Max 2002: one ID texture for all polygons, sampled with NEAREST_MIPMAP_NEAREST, so that the hardware's level
// of detail links shooter and patch. The texel names the patch (low bits), the vertex the polygon (high bits).

layout(binding = 0) uniform usampler2D patch_ids;
in vec2 patch_uv;
flat in uint polygon;
flat in float bias;
layout(location = 0) out uint id;

void main() {
#ifdef SEE_THROUGH
  seeThrough();
#endif
  id = polygon | texture(patch_ids, patch_uv, bias).r;
}
