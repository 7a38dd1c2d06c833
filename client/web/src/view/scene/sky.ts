// The sky behind the scene: a triangle that covers the picture and is drawn before everything else.

import {
  BufferGeometry,
  Float32BufferAttribute,
  Mesh,
  type PerspectiveCamera,
  ShaderMaterial,
  type Texture,
  Vector3,
} from 'three';
import type { Gltf, Vec3 } from '../../document/gltf';
import { isObject } from '../../document/json_patch';
import type { Sky } from '../../protocol/messages';
import { specialise, type ViewUniforms } from './lit_material';
import { SKY_FRAGMENT, SKY_VERTEX } from './lit_shader';
import type { SkyPicture } from './sky_picture';
import { luminance } from '../../page/colours';

/** The sky of a document; undefined: it has none, or none that the server would accept. */
export function skyOf({ extras }: Gltf): Sky | undefined {
  const sky = isObject(extras) ? extras['radiositySky'] : undefined;
  if (!isObject(sky) || !isRadiance(sky['upper'])) return undefined;
  const { upper, lower = upper } = sky;
  return isRadiance(lower) ? { upper, lower } : undefined;
}

/** Undefined: there is no sky, or a black one. */
export function shining(sky: Sky | undefined): Sky | undefined {
  return sky && Math.max(...sky.upper, ...sky.lower) > 0 ? sky : undefined;
}

function isRadiance(value: unknown): value is Vec3 {
  return Array.isArray(value) && value.length === 3 && value.every((v) => typeof v === 'number' && v >= 0);
}

export class SkyBackground {
  readonly mesh: Mesh<BufferGeometry, ShaderMaterial>;
  /** The sky of the scene's document. */
  ofScene: Sky | undefined;
  /** The sky of the solve's settings, for scenes without a sky of their own. */
  ofSettings: Sky | undefined;
  /** All of the sky, where it is more than colours. */
  private picture: SkyPicture | undefined;
  private readonly colours = {
    skyUpper: { value: new Vector3() },
    skyLower: { value: new Vector3() },
    skyIsPicture: { value: false },
    skyPicture: { value: null as Texture | null },
  };

  constructor(private readonly view: ViewUniforms) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    const material = new ShaderMaterial({
      vertexShader: SKY_VERTEX,
      fragmentShader: SKY_FRAGMENT,
      defines: view.defines,
      uniforms: { ...view.all, ...this.colours },
      depthTest: false,
      depthWrite: false,
    });
    this.mesh = new Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = -1;
    this.mesh.visible = false;
  }

  get sky(): Sky | undefined {
    return shining(this.ofScene ?? this.ofSettings);
  }

  /** There is something to draw. */
  get shines(): boolean {
    return this.picture !== undefined || this.sky !== undefined;
  }

  setPicture(picture: SkyPicture | undefined): void {
    this.picture?.dispose();
    this.picture = picture;
    this.colours.skyIsPicture.value = picture !== undefined;
    this.colours.skyPicture.value = picture?.texture ?? null;
  }

  /** Before each frame. `isShown`: the view shows the colours of light that leaves surfaces, and there is some. */
  refresh(isShown: boolean): void {
    const { sky } = this;
    this.mesh.visible = isShown && this.shines;
    if (!this.mesh.visible) return;
    if (sky) {
      this.colours.skyUpper.value.set(...sky.upper);
      this.colours.skyLower.value.set(...sky.lower);
    }
    specialise(this.mesh.material, this.view.defines);
  }

  /** Luminance (nits) where a camera sees only the sky. `x`, `y`: normalised device coordinates. */
  luminanceAt(camera: PerspectiveCamera, x: number, y: number): number {
    const { sky, picture } = this;
    const ahead = new Vector3(x, y, 0.5).unproject(camera).sub(camera.position);
    if (picture) return luminance(picture.at(ahead));
    if (!sky) return 0;
    return luminance(ahead.y >= 0 ? sky.upper : sky.lower);
  }
}
