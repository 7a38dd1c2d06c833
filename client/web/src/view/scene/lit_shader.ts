// GLSL that turns a three.js Lambert material into one that is lit by pages of irradiance, with all views of the scene.
// Each view and tone curve has its own program (ViewUniforms.defines): one program for all of them took three times as
// long a pixel in software, which takes both ways of each branch. The exposure meter uses the same programs.

import { ShaderChunk } from 'three';
import { glslList, MIP_STOPS, paletteGlsl } from '../looks/palette';

/** Pages. `pageResident` holds the finest mip that has come for each tile of 64 x 64 texels; 255: none. */
const PAGE_PARS = `
uniform sampler2D pageResident;
uniform vec2 pageSize;
uniform float pageTiles;
uniform bool pageLightShown;  // false: there is no light yet, or its exposure is unknown
uniform bool measuring;       // linear radiance for the exposure meter
const float kNothing = 15.5;

// The finest mip that has come for all four texels of a bilinear lookup.
float residentMip(vec2 uv) {
  if (!pageLightShown && !measuring) return 255.0;
  vec2 texel = 0.75 / pageSize, tiles = pageSize / pageTiles;
  float mip = 0.0;
  for (int i = 0; i < 4; ++i) {
    vec2 at = clamp(uv + texel * vec2((i & 1) != 0 ? 1.0 : -1.0, (i & 2) != 0 ? 1.0 : -1.0), vec2(0.0), vec2(0.9999));
    mip = max(mip, texelFetch(pageResident, ivec2(at * tiles), 0).r * 255.0);
  }
  return mip;
}

// Charts lie two texels apart and mix beyond mip 1, so minification ends there.
float lookupMip(vec2 uv, out float resident) {
  #if WHOLE_PAGES == 1  // without the lookup, which takes a third of a frame in software
    resident = 0.0;
  #else
    resident = residentMip(uv);
  #endif
  vec2 dx = dFdx(uv) * pageSize, dy = dFdy(uv) * pageSize;
  float wanted = clamp(0.5 * log2(max(dot(dx, dx), dot(dy, dy))), 0.0, 1.0);
  return max(wanted, resident);
}`;

/** From radiance to the screen. TONE_CURVE: 0 neutral, 1 ACES, 2 AgX, 3 none. */
const DISPLAY_PARS = `
${ShaderChunk.tonemapping_pars_fragment}

vec3 encodeSrgb(vec3 c) {
  c = clamp(c, 0.0, 1.0);
  return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, c * 12.92, vec3(lessThanEqual(c, vec3(0.0031308))));
}

vec3 toneMapped(vec3 radiance) {
  #if TONE_CURVE == 0
    return NeutralToneMapping(radiance);
  #elif TONE_CURVE == 1
    return ACESFilmicToneMapping(radiance);
  #elif TONE_CURVE == 2
    return AgXToneMapping(radiance);
  #else
    return radiance * toneMappingExposure;
  #endif
}

// Up to half a step of the screen's 256, so that fading light shows no bands. Interleaved gradient noise (Jimenez, Next
// Generation Post Processing in Call of Duty, 2014), the same in each frame.
vec3 dither() {
  float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  return (fract(noise + vec3(0.0, 1.0, 2.0) / 3.0) - 0.5) / 255.0;
}

vec3 displayed(vec3 radiance) { return encodeSrgb(toneMapped(radiance)) + dither(); }`;

const VIEW_PARS = `
// VIEW_MODE: ViewMode.number; FALSE_COLOUR: 0 or 1
uniform vec2 falseRange;     // lowest and highest value of the logarithmic scale
uniform float previewLight;  // irradiance of surfaces that no light has come for
${paletteGlsl()}
${DISPLAY_PARS}

float luminanceOf(vec3 c) { return dot(c, vec3(0.2126, 0.7152, 0.0722)); }

vec3 measured(float value) {
  if (!(value > 0.0)) return kStops[0] * 0.5;  // NOTHING of palette.ts
  return paletteColour(log(value / falseRange.x) / log(falseRange.y / falseRange.x));
}

vec3 mipColour(float mip) {
  const vec3 colours[${MIP_STOPS.length}] = ${glslList(MIP_STOPS)};
  if (mip > kNothing) return vec3(0.25);
  float at = clamp(mip, 0.0, ${(MIP_STOPS.length - 1.001).toFixed(3)});
  return mix(colours[int(at)], colours[int(at) + 1], fract(at));
}

// Each texel has a tint and a line around it, where it is large enough on the screen to show no dots and moire.
vec3 patchColour(vec2 uv, vec3 shade) {
  vec2 at = uv * pageSize;
  uvec2 id = uvec2(at);
  uint hash = id.x * 1973u ^ id.y * 9277u;
  hash = (hash ^ (hash >> 7u)) * 0x2c1b3c6du;
  vec3 tint = 0.55 + 0.45 * vec3(float(hash & 255u), float((hash >> 8u) & 255u), float((hash >> 16u) & 255u)) / 255.0;
  vec2 width = fwidth(at);
  float most = max(width.x, width.y);
  tint = mix(tint, vec3(0.775), smoothstep(0.4, 1.0, most));
  vec2 border = min(fract(at), 1.0 - fract(at)) / max(width, vec2(1e-6));
  float line = (1.0 - smoothstep(0.4, 1.1, min(border.x, border.y))) * (1.0 - smoothstep(0.1, 0.3, most));
  return mix(shade * tint, vec3(0.02), 0.8 * line);
}`;

export const FRAGMENT_PARS = `
#ifdef USE_LIGHTMAP
  uniform sampler2D dataPage;
  uniform float dataScale;
#endif
uniform vec3 mirrored;  // the part that is not reflected diffusely: (0, 0, metallic), or the specular factor
${PAGE_PARS}
${VIEW_PARS}
`;

/** Replaces lights_fragment_maps: the page's irradiance, or light from the viewer until there is some. */
export const LIGHT_FRAGMENT = `
  vec3 pageIrradiance = vec3(0.0);
  float pageMip = 99.0;
  #ifdef USE_LIGHTMAP
    float resident;
    pageMip = lookupMip(vLightMapUv, resident);
    pageIrradiance = resident > kNothing ? vec3(previewLight * (0.35 + 0.65 * abs(normal.z)))
                                         : textureLod(lightMap, vLightMapUv, pageMip).rgb * lightMapIntensity;
  #endif
  irradiance += pageIrradiance;
`;

/** Replaces the chunks for opacity, tone mapping and colour space. */
export const OUTPUT_FRAGMENT = `
  #ifdef OPAQUE
    diffuseColor.a = 1.0;
  #endif
  #if VIEW_MODE == 1 || VIEW_MODE == 5  // shownLight() of view_modes.ts
    vec3 shownLight = pageIrradiance * RECIPROCAL_PI;
  #else
    vec3 shownLight = outgoingLight;
  #endif
  vec3 shade = vec3(0.0);
  #if VIEW_MODE == 0
    shade = displayed(shownLight);
  #elif VIEW_MODE == 1 && FALSE_COLOUR == 1
    shade = measured(luminanceOf(pageIrradiance));
  #elif VIEW_MODE == 1
    shade = displayed(shownLight);
  #elif VIEW_MODE == 2
    shade = measured(luminanceOf(outgoingLight * PI));
  #elif VIEW_MODE == 3 || VIEW_MODE == 4
    #ifdef USE_LIGHTMAP
      shade = measured(luminanceOf(textureLod(dataPage, vLightMapUv, 0.0).rgb * dataScale));
    #endif
  #elif VIEW_MODE == 5
    #ifdef USE_LIGHTMAP
      // Makes up for the light that tints and lines take away.
      shade = patchColour(vLightMapUv, displayed(1.6 * shownLight));
    #endif
  #elif VIEW_MODE == 6
    shade = mipColour(pageMip) * (0.7 + 0.3 * abs(normal.z));
  #elif VIEW_MODE == 7
    shade = inverseTransformDirection(normal, viewMatrix) * 0.5 + 0.5;
  #else
    shade = encodeSrgb(diffuseColor.rgb) * (0.82 + 0.18 * abs(normal.z)); // shades edges between white surfaces
  #endif
  if (measuring) shade = shownLight;
  gl_FragColor = vec4(shade, diffuseColor.a);
  #ifdef USE_LIGHTMAP
    if (measuring && resident > kNothing) gl_FragColor.a = 0.0; // the meter ignores surfaces without light
  #endif
`;

/** The flat view of one page. */
export const FLAT_VERTEX = `
varying vec2 vUv;
uniform vec2 pageUsed;
void main() {
  vUv = uv * pageUsed;
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

export const FLAT_FRAGMENT = `
#include <common>
varying vec2 vUv;
uniform sampler2D lightMap;
uniform float lightMapIntensity;
${PAGE_PARS}
${VIEW_PARS}
void main() {
  float resident = residentMip(vUv);
  vec2 texel = (floor(vUv * pageSize) + 0.5) / pageSize;
  bool magnified = max(fwidth(vUv.x) * pageSize.x, fwidth(vUv.y) * pageSize.y) < 0.5;
  vec3 irradiance = textureLod(lightMap, magnified && resident < 0.5 ? texel : vUv, resident).rgb * lightMapIntensity;
  #if FALSE_COLOUR == 1
    vec3 shade = measured(luminanceOf(irradiance));
  #else
    vec3 shade = displayed(irradiance * RECIPROCAL_PI);
  #endif
  gl_FragColor = vec4(resident > kNothing ? vec3(0.25) : shade, 1.0);
}`;

/** A triangle that covers the picture. `rise`: how steeply the view ray goes up or down; `ray`: all of it. */
export const SKY_VERTEX = `
varying float rise;
varying vec3 ray;
void main() {
  vec3 seen = vec3(position.x / projectionMatrix[0][0], position.y / projectionMatrix[1][1], -1.0);
  ray = transpose(mat3(viewMatrix)) * seen;
  rise = ray.y;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

/** Pixels on the horizon mix both parts of the sky, as in the server's pictures. A picture is all of it. */
export const SKY_FRAGMENT = `
#include <common>
varying float rise;
varying vec3 ray;
uniform vec3 skyUpper, skyLower;  // nits
uniform bool skyIsPicture;
uniform sampler2D skyPicture;     // equirectangular, row 0 at the zenith
uniform bool measuring;           // the exposure does not depend on the sky
${DISPLAY_PARS}
void main() {
  float above = clamp(0.5 + rise / max(length(vec2(dFdx(rise), dFdy(rise))), 1e-9), 0.0, 1.0);
  vec3 nits = mix(skyLower, skyUpper, above);
  if (skyIsPicture) {
    vec3 d = normalize(ray);
    // Across the seam the coordinate jumps: the largest level of the texture is its only one.
    nits = textureLod(skyPicture, vec2(atan(d.z, d.x) * 0.5 * RECIPROCAL_PI + 0.5, acos(clamp(d.y, -1.0, 1.0)) * RECIPROCAL_PI), 0.0).rgb;
  }
  gl_FragColor = measuring ? vec4(0.0) : vec4(displayed(nits), 1.0);
}`;
