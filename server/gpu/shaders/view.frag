// One quantity of the lit scene, linear (ViewQuantity in view_renderer.h, same order).
in vec3 view_normal;
in vec3 albedo_factor;
in vec4 texture_uv;
in vec4 shine_texture_uv;
in vec2 page_uv;
flat in vec3 emission_factor;
layout(location = 0) out vec4 shade;

layout(binding = 0) uniform sampler2D base_color;
layout(binding = 1) uniform sampler2D emissive;
layout(binding = 2) uniform sampler2D page;
layout(binding = 3) uniform sampler2D metallic_texture;
layout(binding = 4) uniform sampler2D specular_texture;
layout(location = 1) uniform int quantity;
layout(location = 2) uniform float alpha_cutoff;  // -1: no test; -2: alpha covers so many of the samples
layout(location = 3) uniform float base_alpha;
layout(location = 5) uniform float metallic;
layout(location = 6) uniform vec3 specular;
layout(location = 4) uniform float data_scale;    // brings the data of kError and kMipLevel to 0..1

const float kPi = 3.14159265358979;

// Every ninth colour of viridis (matplotlib, CC0), sRGB of 255, over 0..1: lighter all the way. The live viewer has the same.
const vec3 kStops[9] = vec3[](vec3(68, 1, 84), vec3(71, 45, 123), vec3(59, 82, 139),
                            vec3(44, 114, 142), vec3(33, 145, 140), vec3(40, 174, 128),
                            vec3(94, 201, 98), vec3(173, 220, 48), vec3(253, 231, 37));

vec3 falseColor(float t) {
  t = clamp(t, 0.0, 1.0) * 8.0;
  int low = min(int(t), 7);
  return mix(kStops[low], kStops[low + 1], t - float(low)) / 255.0;
}

vec3 hashColor(uint id) {
  id = (id ^ 61u) ^ (id >> 16);
  id *= 9u;
  id ^= id >> 4;
  id *= 0x27d4eb2du;
  id ^= id >> 15;
  return vec3(id & 255u, id >> 8 & 255u, id >> 16 & 255u) / 255.0;
}

// Blending without an order: alpha of the four samples are covered, by chance between two numbers, and not the same ones
// everywhere.
void coverSamples(float alpha) {
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  vec3 chance = hashColor(pixel.x * 1973u + pixel.y * 9277u + uint(gl_FragCoord.z * 1048576.0) * 26699u);
  uint count = min(uint(floor(4.0 * alpha + chance.x)), 4u);
  if (count == 0u) discard;
  uint samples = (1u << count) - 1u, turn = uint(chance.y * 3.999);
  gl_SampleMask[0] = int((samples << turn | samples >> (4u - turn)) & 15u);
}

void main() {
  vec4 base = texture(base_color, texture_uv.xy);
  gl_SampleMask[0] = ~0;
  float alpha = base.a * base_alpha;
  if (alpha < alpha_cutoff) discard;
  if (alpha_cutoff < -1.5) coverSamples(alpha);
  // What metal and the specular part take is not reflected diffusely.
  vec3 mirrored = specular * texture(specular_texture, shine_texture_uv.zw).rgb;
  float diffuse = (1.0 - metallic * texture(metallic_texture, shine_texture_uv.xy).b)
      * (1.0 - max(max(mirrored.r, mirrored.g), mirrored.b));
  vec3 albedo = min(base.rgb * albedo_factor * diffuse, vec3(0.999));
  vec3 emission = texture(emissive, texture_uv.zw).rgb * emission_factor;
  vec3 irradiance = max(texture(page, page_uv).rgb, vec3(0.0));
  vec3 result = irradiance;
  if (quantity == 0) {
    result = albedo * irradiance / kPi + emission;
  } else if (quantity == 2) {
    result = albedo * irradiance + kPi * emission;
  } else if (quantity == 3 || quantity == 5) {
    result = falseColor(dot(irradiance, vec3(1.0 / 3.0)) * data_scale);
  } else if (quantity == 4) {
    ivec2 texel = ivec2(page_uv * vec2(textureSize(page, 0)));
    result = hashColor(uint(texel.y) * 65536u + uint(texel.x));
  } else if (quantity == 6) {
    result = normalize(gl_FrontFacing ? view_normal : -view_normal) * 0.5 + 0.5;
  }
  shade = vec4(result, 1.0);
}
