// three.js materials lit by lightmap pages, and the way of a glTF material's edits to them. As on the server, each
// surface is Lambertian with reflectance base colour x (1 - metallic), at most 0.999.

import {
  type Color,
  DoubleSide,
  FrontSide,
  MeshLambertMaterial,
  SRGBColorSpace,
  type Material,
  type MeshStandardMaterial,
  type Texture,
  Vector2,
  Vector3,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import type { GltfMaterial, GltfTextureInfo, SpecularGlossiness } from '../../document/gltf';
import type { LightmapPage } from '../light/lightmap_page';
import { FRAGMENT_PARS, LIGHT_FRAGMENT, OUTPUT_FRAGMENT } from './lit_shader';

/** Values that are compiled into programs, by their names there. */
export type Defines = Readonly<Record<'VIEW_MODE' | 'TONE_CURVE' | 'FALSE_COLOUR' | 'WHOLE_PAGES', number>>;

/** The uniforms that all materials share, and the choice of the programs. */
export class ViewUniforms {
  readonly all = {
    measuring: { value: false },
    falseRange: { value: new Vector2(1, 1000) },
    previewLight: { value: 1 },
    toneMappingExposure: { value: 1 },
  };
  /** A new object whenever a value changes. */
  defines: Defines = { VIEW_MODE: 0, TONE_CURVE: 0, FALSE_COLOUR: 0, WHOLE_PAGES: 0 };
  /** The same for pages of which all light is there. */
  wholeDefines: Defines = { ...this.defines, WHOLE_PAGES: 1 };

  /** Materials take the change up when they are next specialised. */
  choose(change: Partial<Omit<Defines, 'WHOLE_PAGES'>>): void {
    const chosen = { ...this.defines, ...change };
    const names = Object.keys(chosen) as (keyof Defines)[];
    if (names.every((name) => chosen[name] === this.defines[name])) return;
    this.defines = chosen;
    this.wholeDefines = { ...chosen, WHOLE_PAGES: 1 };
  }
}

/** Gives a material the program with these values. True: it had another program. */
export function specialise(material: Material, defines: Defines): boolean {
  if (material.defines === defines) return false;
  material.defines = defines; // three.js also keeps the old program for a return to it
  material.needsUpdate = true;
  return true;
}

export class LitMaterial extends MeshLambertMaterial {
  readonly own = {
    mirrored: { value: new Vector3() },
    dataPage: { value: null as Texture | null },
    dataScale: { value: 1 },
  };
  page: LightmapPage | undefined;
  dataPage: LightmapPage | undefined;
  /** The server lights both sides, because of the document or of a setting. A change of either brings new geometry. */
  private readonly bothSides: boolean;

  constructor(
    source: Material,
    private readonly view: ViewUniforms,
    page: LightmapPage | undefined,
    /** False: the emissive texture is black on all of these faces. */
    private readonly emits = true,
  ) {
    super();
    this.defines = view.defines;
    const from = source as MeshStandardMaterial;
    this.name = from.name;
    this.color.copy(from.color);
    this.map = from.map;
    this.vertexColors = from.vertexColors;
    this.flatShading = from.flatShading;
    this.side = from.side === DoubleSide ? DoubleSide : FrontSide;
    this.bothSides = this.side === DoubleSide;
    this.alphaTest = from.alphaTest;
    this.transparent = from.transparent;
    this.depthWrite = from.depthWrite;
    this.opacity = from.opacity;
    if (from.emissive) {
      this.emissive.copy(from.emissive);
      this.emissiveIntensity = from.emissiveIntensity;
      this.emissiveMap = from.emissiveMap;
    }
    this.comeBefore();
    this.applyTransmission(from);
    const specular = from.userData[SPECULAR] as Specular | undefined;
    this.specularMap = specular ? specular.map : from.metalnessMap;
    this.own.mirrored.value.set(...(specular?.factor ?? ([0, 0, from.metalness ?? 0] as const)));
    this.setPage(page);
    this.onBeforeCompile = (shader) => this.extend(shader);
  }

  /** Turns three.js's Lambert program into one that is lit by pages. */
  private extend(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(shader.uniforms, this.view.all, this.own, this.page?.uniforms ?? noPage());
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <lights_lambert_pars_fragment>', (chunk) => chunk + FRAGMENT_PARS)
      .replace('#include <lights_lambert_fragment>', (chunk) => REFLECTANCE + chunk)
      .replace('#include <lights_fragment_maps>', LIGHT_FRAGMENT)
      .replace('#include <opaque_fragment>', OUTPUT_FRAGMENT)
      .replace('#include <tonemapping_fragment>', '')
      .replace('#include <colorspace_fragment>', '');
  }

  /** All materials share programs: three.js knows of the defines in which they differ. */
  override customProgramCacheKey(): string {
    return 'radiosity';
  }

  /** Takes the program of the present view. True: the material had another program. */
  specialise(whole: boolean): boolean {
    return specialise(this, whole ? this.view.wholeDefines : this.view.defines);
  }

  /** The scale of the page may have changed since the last frame. */
  refresh(): void {
    if (this.page) this.lightMapIntensity = this.page.scale;
    this.own.dataScale.value = this.dataPage?.scale ?? 0;
  }

  setDataPage(page: LightmapPage | undefined): void {
    this.dataPage = page;
    this.own.dataPage.value = page?.texture ?? null; // without data there is nothing to see, as light is no data
  }

  /** A surface looks the same everywhere, apart from its light. */
  get isPlain(): boolean {
    return (
      !this.map &&
      !this.emissiveMap &&
      !this.specularMap &&
      !this.vertexColors &&
      !this.transparent &&
      this.alphaTest === 0
    );
  }

  /** It neither reflects light diffusely nor emits any, as a metal. */
  get isBlack(): boolean {
    const { color, emissive, emissiveIntensity: strength } = this;
    const most = (c: Color) => Math.max(c.r, c.g, c.b);
    const diffuse = this.specularMap ? 1 : this.diffuseShare;
    return most(color) * diffuse < 1e-4 && most(emissive) * strength === 0;
  }

  /** Radiance of a plain surface in nits, as the shader computes it; `irradiance` in lux. */
  radianceOf(irradiance: readonly [number, number, number]): [number, number, number] {
    const rho = (c: number) => Math.min(0.999, c * this.diffuseShare) / Math.PI;
    const { color, emissive, emissiveIntensity: strength } = this;
    return [
      emissive.r * strength + rho(color.r) * irradiance[0],
      emissive.g * strength + rho(color.g) * irradiance[1],
      emissive.b * strength + rho(color.b) * irradiance[2],
    ];
  }

  /** Takes the members that an edit may have changed. */
  edit(gltf: GltfMaterial): void {
    const pbr = gltf.pbrMetallicRoughness ?? {};
    const gloss = gltf.extensions?.KHR_materials_pbrSpecularGlossiness;
    const [r = 1, g = 1, b = 1, a = 1] = (gloss ? gloss.diffuseFactor : pbr.baseColorFactor) ?? [];
    this.color.setRGB(r, g, b);
    if (this.transparent) this.opacity = a;
    const mirrored: readonly [number, number, number] = gloss
      ? (gloss.specularFactor ?? [1, 1, 1])
      : [0, 0, pbr.metallicFactor ?? 1];
    this.own.mirrored.value.set(...mirrored);
    this.emissive.setRGB(...(gltf.emissiveFactor ?? [0, 0, 0]));
    this.emissiveIntensity = gltf.extensions?.KHR_materials_emissive_strength?.emissiveStrength ?? 1;
    this.comeBefore();
    // A surface with a page has faces for each lit side; a change of sides brings new geometry.
    const side = (gltf.doubleSided || this.bothSides) && !this.page ? DoubleSide : FrontSide;
    if (side !== this.side) {
      this.side = side;
      this.needsUpdate = true;
    }
  }

  /** Where faces lie on each other, the one that emits is seen, as on the server. */
  private comeBefore(): void {
    const { emissive, emissiveIntensity } = this;
    this.polygonOffset = this.emits && Math.max(emissive.r, emissive.g, emissive.b) * emissiveIntensity > 0;
    this.polygonOffsetFactor = this.polygonOffsetUnits = -1;
  }

  /** Part of the light that is reflected diffusely, unless a texture reduces it. */
  private get diffuseShare(): number {
    return 1 - Math.max(...this.own.mirrored.value.toArray());
  }

  private setPage(page: LightmapPage | undefined): void {
    this.page = page;
    this.lightMap = page?.texture ?? null;
    this.refresh();
  }

  /** A transmissive surface, through which the server lets light pass at random, is drawn half transparent. */
  private applyTransmission(from: MeshStandardMaterial & { transmission?: number }): void {
    if (!from.transmission) return;
    this.transparent = true;
    this.depthWrite = false;
    this.opacity *= 1 - 0.9 * from.transmission;
  }
}

/** three.js's specular map is the metallic or the specular texture here. */
const REFLECTANCE = `
  vec3 mirror = mirrored;
  #ifdef USE_SPECULARMAP
    mirror *= texelSpecular.rgb;
  #endif
  diffuseColor.rgb = min(diffuseColor.rgb * (1.0 - max(max(mirror.r, mirror.g), mirror.b)), vec3(0.999));
`;

function noPage() {
  return {
    pageResident: { value: null },
    pageSize: { value: [1, 1] },
    pageUsed: { value: [1, 1] },
    pageTiles: { value: 64 },
    pageLightShown: { value: false },
  };
}

/** Member of a material's userData for KHR_materials_pbrSpecularGlossiness, which three.js does not read. */
const SPECULAR = 'specular';
interface Specular {
  factor: readonly [number, number, number];
  map: Texture | null;
}

/** Gives a material the colours of the extension, which three.js has ignored. */
export async function readSpecularGlossiness(
  material: MeshStandardMaterial,
  gloss: SpecularGlossiness,
  textureOf: (info: GltfTextureInfo) => Promise<Texture | null>,
): Promise<void> {
  const [r = 1, g = 1, b = 1, a = 1] = gloss.diffuseFactor ?? [];
  material.color.setRGB(r, g, b);
  material.opacity = a;
  material.map = gloss.diffuseTexture ? await textureOf(gloss.diffuseTexture) : null;
  const map = gloss.specularGlossinessTexture ? await textureOf(gloss.specularGlossinessTexture) : null;
  material.userData[SPECULAR] = { factor: gloss.specularFactor ?? [1, 1, 1], map } satisfies Specular;
}

/** Keeps textures sharp at a slant. */
export function sharpen(material: Material, anisotropy: number): void {
  const { map, emissiveMap } = material as MeshLambertMaterial;
  for (const texture of [map, emissiveMap]) {
    if (!texture) continue;
    texture.anisotropy = anisotropy;
    texture.colorSpace = SRGBColorSpace;
  }
}
