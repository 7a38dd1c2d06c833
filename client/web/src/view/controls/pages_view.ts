// The view of the lightmap pages, side by side, which the user can pan and zoom.

import { Box3, Mesh, OrthographicCamera, PlaneGeometry, Scene, ShaderMaterial, Vector2, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { specialise, type ViewUniforms } from '../scene/lit_material';
import type { LightmapPage } from '../light/lightmap_page';
import type { LightmapSet } from '../light/lightmap_set';
import { FLAT_FRAGMENT, FLAT_VERTEX } from '../scene/lit_shader';
import type { LitScene } from '../scene/lit_scene';
import { surfaceAt } from '../rays/page_surface';
import { readingAt, type Reading } from '../rays/picker';

const GAP = 0.04;

/** The reading of a texel that belongs to no surface. */
const NOWHERE = {
  point: undefined,
  irradiance: undefined,
  error: undefined,
  radiosity: undefined,
  node: undefined,
  material: undefined,
  isGap: true,
};

export class PagesView {
  readonly scene = new Scene();
  readonly camera = new OrthographicCamera(-1, 1, 1, -1, 0.1, 10);
  private readonly controls: OrbitControls;
  private readonly box = new Box3();
  private shownSet: LightmapSet | undefined;
  private made: { mesh: Mesh; material: ShaderMaterial; page: LightmapPage }[] = [];

  constructor(
    element: HTMLElement,
    private readonly view: ViewUniforms,
    private readonly moved: () => void,
  ) {
    this.camera.position.z = 5;
    this.controls = new OrbitControls(this.camera, element);
    this.controls.enableRotate = false;
    this.controls.screenSpacePanning = true;
    this.controls.zoomToCursor = true;
    this.controls.mouseButtons.LEFT = 2 as never; // pan
    this.controls.touches.ONE = 1 as never; // pan
    this.controls.enabled = false;
    this.controls.addEventListener('change', moved);
  }

  set active(active: boolean) {
    this.controls.enabled = active;
  }

  /** Lays the pages out in rows, in nearly a square. */
  show(set: LightmapSet | undefined): void {
    if (set === this.shownSet) return;
    for (const { mesh, material } of this.made) {
      mesh.removeFromParent();
      mesh.geometry.dispose();
      material.dispose();
    }
    this.made = [];
    this.shownSet = set;
    if (!set) return;
    const largest = Math.max(...set.pages.map((page) => Math.max(page.width, page.height)), 1);
    const columns = Math.ceil(Math.sqrt(set.pages.length));
    this.made = set.pages.map((page, i) => {
      const mesh = this.makeMesh(page, largest);
      mesh.position.set((i % columns) * (1 + GAP), -Math.floor(i / columns) * (1 + GAP), 0);
      this.scene.add(mesh);
      return { mesh, material: mesh.material as ShaderMaterial, page };
    });
    this.box.setFromObject(this.scene);
    this.frame();
  }

  frame(): void {
    const centre = this.box.getCenter(new Vector3());
    this.controls.target.set(centre.x, centre.y, 0);
    this.camera.position.set(centre.x, centre.y, 5);
    this.camera.zoom = 1;
    this.resize(this.camera.right / this.camera.top);
    this.controls.update();
  }

  /** Steps are parts of the picture's height. */
  pan(right: number, up: number): void {
    const { top, zoom, position } = this.camera;
    const step = new Vector3(right, up, 0).multiplyScalar((2 * top) / zoom);
    position.add(step);
    this.controls.target.add(step);
    this.moved();
  }

  /** Nearer for factors below 1. */
  zoom(factor: number): void {
    this.camera.zoom /= factor;
    this.camera.updateProjectionMatrix();
    this.moved();
  }

  resize(aspect: number): void {
    const size = this.box.isEmpty() ? new Vector3(1, 1, 1) : this.box.getSize(new Vector3());
    const half = 0.56 * Math.max(size.y, size.x / aspect);
    Object.assign(this.camera, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    this.camera.updateProjectionMatrix();
  }

  /**
   * The light and the surface of a texel; undefined: the place is beside the pages. `scene`: the scene of the pages.
   * `x`, `y`: normalised device coordinates.
   */
  readAt(scene: LitScene, x: number, y: number): Reading | undefined {
    const at = new Vector3(x, y, 0).unproject(this.camera);
    for (const [index, { mesh, page }] of this.made.entries()) {
      const { width, height } = (mesh.geometry as PlaneGeometry).parameters;
      const [u, v] = [(at.x - mesh.position.x) / width + 0.5, (at.y - mesh.position.y) / height + 0.5];
      if (u < 0 || u >= 1 || v < 0 || v >= 1) continue;
      const texel: [number, number] = [Math.floor(u * page.width), Math.floor(v * page.height)];
      // Without interpolation, as the texel's neighbours may belong to other surfaces.
      const middle = new Vector2((texel[0] + 0.5) / page.width, (texel[1] + 0.5) / page.height);
      const hit = surfaceAt(scene, page, new Vector2(u, v)) ?? surfaceAt(scene, page, middle);
      if (!hit) return { ...NOWHERE, page: index, texel };
      return { ...readingAt(scene, hit), irradiance: page.sample(middle.x, middle.y), page: index, texel };
    }
    return undefined;
  }

  refresh(): void {
    this.controls.update();
    for (const { material, page } of this.made) {
      specialise(material, this.view.defines);
      material.uniforms['lightMapIntensity']!.value = page.scale;
    }
  }

  private makeMesh(page: LightmapPage, largest: number): Mesh {
    const material = new ShaderMaterial({
      vertexShader: FLAT_VERTEX,
      fragmentShader: FLAT_FRAGMENT,
      defines: this.view.defines,
      uniforms: {
        ...this.view.all,
        ...page.uniforms,
        lightMap: { value: page.texture },
        lightMapIntensity: { value: page.scale },
      },
    });
    return new Mesh(new PlaneGeometry(page.width / largest, page.height / largest), material);
  }
}
