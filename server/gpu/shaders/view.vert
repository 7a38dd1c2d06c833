// Scene to camera.
layout(location = 0) in vec3 position;  // relative to the camera's position, world axes
layout(location = 1) in vec3 normal;
layout(location = 2) in vec4 color;     // vertex colour x base colour factor
layout(location = 3) in vec4 uv;        // base colour texture, emissive texture
layout(location = 4) in vec2 lightmap_uv;
layout(location = 5) in vec3 emission;  // factor, nits
layout(location = 6) in vec4 shine_uv;  // metallic texture, specular texture
layout(location = 0) uniform mat4 clip_from_view;

out vec3 view_normal;
out vec3 albedo_factor;
out vec4 texture_uv;
out vec4 shine_texture_uv;
out vec2 page_uv;
flat out vec3 emission_factor;

void main() {
  gl_Position = clip_from_view * vec4(position, 1.0);
  view_normal = normal;
  albedo_factor = color.rgb;
  texture_uv = uv;
  shine_texture_uv = shine_uv;
  page_uv = lightmap_uv;
  emission_factor = emission;
}
