// three.js materials lit by lightmap pages, and how an edit of a glTF material reaches them. Every surface is Lambertian
// with reflectance base colour x (1 - metallic), at most 0.999, as the server has it.

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
} from 'three';
import type { GltfMaterial, GltfTextureInfo, SpecularGlossiness } from '../../document/gltf';
import type { LightmapPage } from '../light/lightmap_page';
import { FRAGMENT_PARS, LIGHT_FRAGMENT, OUTPUT_FRAGMENT } from './lit_shader';

/** What is compiled into programs, by its name there. */
export type Defines = Readonly<Record<'VIEW_MODE' | 'TONE_CURVE' | 'FALSE_COLOUR' | 'WHOLE_PAGES', number>>;

/** What all materials have in common. */
export class ViewUniforms {
  readonly all = {
    measuring: { value: false },
    falseRange: { value: new Vector2(1, 1000) },
    previewLight: { value: 1 },
    toneMappingExposure: { value: 1 },
  };
  /** Another object whenever something in it is another. */
  defines: Defines = { VIEW_MODE: 0, TONE_CURVE: 0, FALSE_COLOUR: 0, WHOLE_PAGES: 0 };
  /** The same, for pages of which all light is there. */
  wholeDefines: Defines = { ...this.defines, WHOLE_PAGES: 1 };

  /** Materials take it up when they are next refreshed. */
  choose(change: Partial<Omit<Defines, 'WHOLE_PAGES'>>): void {
    const chosen = { ...this.defines, ...change };
    const names = Object.keys(chosen) as (keyof Defines)[];
    if (names.every((name) => chosen[name] === this.defines[name])) return;
    this.defines = chosen;
    this.wholeDefines = { ...chosen, WHOLE_PAGES: 1 };
  }
}

/** Gives a material the program with these. True: it had another. */
export function specialise(material: Material, defines: Defines): boolean {
  if (material.defines === defines) return false;
  material.defines = defines; // with those it had before three.js keeps the program, too
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
  /** The server lights both, be it that a setting says so and not the document. An edit brings another file. */
  private readonly bothSides: boolean;

  constructor(
    source: Material,
    private readonly view: ViewUniforms,
    page: LightmapPage | undefined,
    /** False: its emissive texture is black wherever it is on these faces. */
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
    this.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, view.all, this.own, this.page?.uniforms ?? noPage());
      shader.fragmentShader = shader.fragmentShader
        .replace('#include <lights_lambert_pars_fragment>', (chunk) => chunk + FRAGMENT_PARS)
        .replace('#include <lights_lambert_fragment>', (chunk) => REFLECTANCE + chunk)
        .replace('#include <lights_fragment_maps>', LIGHT_FRAGMENT)
        .replace('#include <opaque_fragment>', OUTPUT_FRAGMENT)
        .replace('#include <tonemapping_fragment>', '')
        .replace('#include <colorspace_fragment>', '');
    };
  }

  /** One program for all of them: what differs is in defines that three.js knows of. */
  override customProgramCacheKey(): string {
    return 'radiosity';
  }

  /** For the view that is chosen now, and pages that are whole or not. True: it had the program of another. */
  specialise(whole: boolean): boolean {
    return specialise(this, whole ? this.view.wholeDefines : this.view.defines);
  }

  /** The page's scale may have grown since the last frame. */
  refresh(): void {
    if (this.page) this.lightMapIntensity = this.page.scale;
    this.own.dataScale.value = this.dataPage?.scale ?? 0;
  }

  setDataPage(page: LightmapPage | undefined): void {
    this.dataPage = page;
    this.own.dataPage.value = page?.texture ?? null; // light is no data: without any there is nothing to see
  }

  /** All of a surface looks the same but for its light. */
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

  /** It neither reflects nor emits light, as a metal that is seen by its mirror images alone. */
  get isBlack(): boolean {
    const { color, emissive, emissiveIntensity: strength } = this;
    const most = (c: Color) => Math.max(c.r, c.g, c.b);
    const diffuse = this.specularMap ? 1 : this.diffuseShare;
    return most(color) * diffuse < 1e-4 && most(emissive) * strength === 0;
  }

  /** Of a plain surface, in nits, as the program has it; irradiance in lux. */
  radianceOf(irradiance: readonly [number, number, number]): [number, number, number] {
    const rho = (c: number) => Math.min(0.999, c * this.diffuseShare) / Math.PI;
    const { color, emissive, emissiveIntensity: strength } = this;
    return [
      emissive.r * strength + rho(color.r) * irradiance[0],
      emissive.g * strength + rho(color.g) * irradiance[1],
      emissive.b * strength + rho(color.b) * irradiance[2],
    ];
  }

  /** Takes on what an edit may change. */
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
    // What has a page is there once for each side that is seen; another choice of sides comes with geometry of its own.
    const side = (gltf.doubleSided || this.bothSides) && !this.page ? DoubleSide : FrontSide;
    if (side !== this.side) {
      this.side = side;
      this.needsUpdate = true;
    }
  }

  /** Of faces that lie on each other the one that emits is seen, as the server lights them. */
  private comeBefore(): void {
    const { emissive, emissiveIntensity } = this;
    this.polygonOffset = this.emits && Math.max(emissive.r, emissive.g, emissive.b) * emissiveIntensity > 0;
    this.polygonOffsetFactor = this.polygonOffsetUnits = -1;
  }

  /** Where no texture says otherwise. */
  private get diffuseShare(): number {
    return 1 - Math.max(...this.own.mirrored.value.toArray());
  }

  private setPage(page: LightmapPage | undefined): void {
    this.page = page;
    this.lightMap = page?.texture ?? null;
    this.refresh();
  }

  /** What the server lets through by chance is half seen through here. */
  private applyTransmission(from: MeshStandardMaterial & { transmission?: number }): void {
    if (!from.transmission) return;
    this.transparent = true;
    this.depthWrite = false;
    this.opacity *= 1 - 0.9 * from.transmission;
  }
}

/** The texture that three.js takes for the strength of reflections is the metallic one here, or the specular one. */
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

/** In a material's userData: what KHR_materials_pbrSpecularGlossiness says of it, which three.js does not read. */
const SPECULAR = 'specular';
interface Specular {
  factor: readonly [number, number, number];
  map: Texture | null;
}

/** Gives a material that three.js read without the extension the colours that it has by it. */
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

/** Albedo pictures stay sharp at a slant. */
export function sharpen(material: Material, anisotropy: number): void {
  const { map, emissiveMap } = material as MeshLambertMaterial;
  for (const texture of [map, emissiveMap]) {
    if (!texture) continue;
    texture.anisotropy = anisotropy;
    texture.colorSpace = SRGBColorSpace;
  }
}
