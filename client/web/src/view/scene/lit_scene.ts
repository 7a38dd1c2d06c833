// The geometry of one lightmap layout as three.js objects, lit by its pages. Knows which node and which material of the
// document each object belongs to.

import {
  Box3,
  type BufferGeometry,
  Group,
  Mesh,
  type MeshLambertMaterial,
  type MeshStandardMaterial,
  type Object3D,
  PerspectiveCamera,
  SRGBColorSpace,
  Texture,
  Vector3,
} from 'three';
import { GLTFLoader, type GLTF, type GLTFLoaderPlugin, type GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import { isVisible } from '../../document/edits';
import type { Gltf, GltfNode, GltfTextureInfo, SpecularGlossiness } from '../../document/gltf';
import type { LampWebs } from '../../document/lights';
import { LampMarker } from './lamp_marker';
import { LampMarkers } from './lamp_markers';
import { LitMaterial, readSpecularGlossiness, sharpen, type ViewUniforms } from './lit_material';
import type { LightmapSet } from '../light/lightmap_set';
import { isSign, trianglesOf } from './object_box';
import { PlaneMarkers } from './plane_markers';

interface Association {
  nodes?: number;
  materials?: number;
}

/**
 * Pictures of KTX2 are those that light does not need, bumps say, and nothing is drawn with them. Without this the whole
 * scene would be refused.
 */
function withoutKtx2(parser: GLTFParser): GLTFLoaderPlugin {
  const textures = (parser.json as { textures?: { source?: number }[] }).textures;
  const loadTexture = (index: number) =>
    textures?.[index]?.source === undefined ? Promise.resolve(new Texture()) : null;
  return { name: 'KHR_texture_basisu', loadTexture };
}

export class LitScene {
  readonly root = new Group();
  /** The document of the GLB that the scene was made from. */
  readonly source: Gltf;
  readonly nodes = new Map<number, Object3D>();
  readonly lamps = new LampMarkers();
  readonly planes = new PlaneMarkers();
  readonly cameras: { name: string; camera: PerspectiveCamera }[] = [];
  triangles = 0;
  /** The materials have programs for pages of which all light is there. */
  showsWhole = false;
  private readonly materials = new Map<number, LitMaterial[]>();
  private readonly made = new Map<string, LitMaterial>();
  private readonly geometries = new Set<BufferGeometry>();
  private readonly textures = new Set<Texture>();
  private readonly nodeNumbers = new Map<Object3D, number>();

  /** Reads a GLB of /scene.glb. Rejects when it cannot be drawn. */
  static async load(glb: ArrayBuffer, set: LightmapSet, view: ViewUniforms, anisotropy: number): Promise<LitScene> {
    const gltf = await new GLTFLoader().register(withoutKtx2).parseAsync(glb, '');
    await readAllSpecularGlossiness(gltf);
    return new LitScene(gltf, set, view, anisotropy);
  }

  private constructor(
    gltf: GLTF,
    readonly set: LightmapSet,
    view: ViewUniforms,
    anisotropy: number,
  ) {
    this.source = gltf.parser.json as Gltf;
    const associations = gltf.parser.associations as unknown as Map<object, Association>;
    const lights: Object3D[] = [];
    gltf.scene.updateMatrixWorld(true);
    gltf.scene.traverse((object) => {
      const { nodes: node } = associations.get(object) ?? {};
      if (node !== undefined && !this.nodes.has(node)) this.nodes.set(node, object);
      if ((object as { isLight?: boolean }).isLight) lights.push(object);
      if (object instanceof PerspectiveCamera) this.takeCamera(object);
      if (object instanceof Mesh) this.light(object, associations, view, anisotropy);
    });
    for (const light of lights) this.putOut(light);
    for (const [node, object] of this.nodes) this.nodeNumbers.set(object, node);
    this.root.add(gltf.scene);
  }

  get bounds(): Box3 {
    const box = new Box3();
    this.root.updateMatrixWorld(true);
    this.root.traverseVisible((object) => {
      if (object instanceof Mesh && !isSign(object)) box.expandByObject(object);
    });
    if (box.isEmpty()) box.setFromCenterAndSize(new Vector3(), new Vector3(1, 1, 1));
    return box;
  }

  /** Brings all objects up to date with the document. */
  applyDocument(gltf: Gltf): void {
    for (const node of this.nodes.keys()) this.applyNode(gltf, node);
    for (const material of this.materials.keys()) this.applyMaterial(gltf, material);
    this.placeSigns(gltf);
  }

  /** Brings the objects of edited members up to date: JSON pointers, which may contain names; none: all. */
  applyPointers(gltf: Gltf, pointers: string[]): void {
    if (pointers.length === 0) return this.applyDocument(gltf);
    for (const pointer of pointers) {
      const [, list, key = ''] = pointer.split('/');
      const elements = (list === 'nodes' ? gltf.nodes : list === 'materials' ? gltf.materials : undefined) ?? [];
      const index = key.startsWith('@') ? elements.findIndex((e) => e.name === key.slice(1)) : Number(key);
      if (list === 'nodes' && elements[index]) this.applyNode(gltf, index);
      else if (list === 'materials' && elements[index]) this.applyMaterial(gltf, index);
      else return this.applyDocument(gltf);
    }
    this.placeSigns(gltf);
  }

  /** The lamp of this node, if it is one, shows more of itself. `webs`: those that are known. */
  selectLamp(node: number | undefined, webs: LampWebs, gltf: Gltf): void {
    this.lamps.select(node, webs);
    this.placeSigns(gltf);
  }

  /** The node that an object belongs to. */
  nodeOf(object: Object3D): number | undefined {
    for (let at: Object3D | null = object; at; at = at.parent) {
      if (at instanceof LampMarker) return at.node;
      const node = this.nodeNumbers.get(at);
      if (node !== undefined) return node;
    }
    return undefined;
  }

  materialIndexOf(object: Object3D): number | undefined {
    const index = object.userData['materialIndex'] as number | undefined;
    return index;
  }

  /** No surface reflects light diffusely or emits any. */
  get isBlack(): boolean {
    return this.made.size > 0 && [...this.made.values()].every((material) => material.isBlack);
  }

  eachMaterial(visit: (material: LitMaterial) => void): void {
    for (const material of this.made.values()) visit(material);
  }

  /** Takes the programs of the present view. True: some materials had others. */
  specialise(whole = this.showsWhole): boolean {
    let differed = false;
    this.eachMaterial((material) => (differed = material.specialise(whole) || differed));
    return differed;
  }

  pickable(): Object3D[] {
    return [this.root, ...this.lamps.values()];
  }

  dispose(): void {
    for (const geometry of this.geometries) geometry.dispose();
    for (const texture of this.textures) texture.dispose();
    for (const material of this.made.values()) material.dispose();
    this.lamps.dispose();
    this.planes.dispose();
    this.root.removeFromParent();
  }

  /** Replaces a light, which the pages contain already, by an empty object. */
  private putOut(light: Object3D): void {
    const empty = new Group();
    empty.name = light.name;
    empty.position.copy(light.position);
    empty.quaternion.copy(light.quaternion);
    empty.scale.copy(light.scale);
    const target = (light as { target?: Object3D }).target;
    for (const child of [...light.children]) if (child !== target) empty.add(child);
    for (const [node, object] of this.nodes) if (object === light) this.nodes.set(node, empty);
    light.parent?.add(empty);
    light.removeFromParent();
  }

  private takeCamera(camera: PerspectiveCamera): void {
    this.cameras.push({ name: camera.name || `camera ${this.cameras.length}`, camera });
  }

  private light(mesh: Mesh, associations: Map<object, Association>, view: ViewUniforms, anisotropy: number): void {
    const geometry = mesh.geometry as BufferGeometry;
    const source = mesh.material as MeshLambertMaterial;
    const extras = geometry.userData as { lightmap?: number; lightmapEmits?: boolean };
    const emits = extras.lightmapEmits ?? true;
    const page = geometry.getAttribute('uv1') ? this.set.pages[extras.lightmap ?? -1] : undefined;
    const index = associations.get(source)?.materials;
    const key = `${source.uuid}/${page ? extras.lightmap : ''}/${emits}`;
    let lit = this.made.get(key);
    if (!lit) {
      sharpen(source, anisotropy);
      lit = new LitMaterial(source, view, page, emits);
      this.made.set(key, lit);
      for (const texture of [lit.map, lit.emissiveMap, lit.specularMap]) if (texture) this.textures.add(texture);
      if (index !== undefined) this.materials.set(index, [...(this.materials.get(index) ?? []), lit]);
    }
    mesh.material = lit;
    mesh.userData['materialIndex'] = index;
    mesh.userData['page'] = page;
    this.geometries.add(geometry);
    this.triangles += trianglesOf(geometry);
  }

  private applyNode(gltf: Gltf, index: number): void {
    const object = this.nodes.get(index);
    const node = gltf.nodes?.[index];
    if (!object || !node || node.matrix) return;
    place(object, node);
    object.visible = isVisible(gltf, index);
  }

  private applyMaterial(gltf: Gltf, index: number): void {
    const material = gltf.materials?.[index];
    if (material) for (const lit of this.materials.get(index) ?? []) lit.edit(material);
  }

  private placeSigns(gltf: Gltf): void {
    this.lamps.place(gltf, this.nodes, this.root, this.bounds.getSize(new Vector3()).length());
    this.planes.place(gltf, this.nodes, this.root);
  }
}

async function readAllSpecularGlossiness(gltf: GLTF): Promise<void> {
  const json = gltf.parser.json as Gltf;
  const associations = gltf.parser.associations as unknown as Map<object, Association>;
  const materials = new Map<MeshStandardMaterial, SpecularGlossiness>();
  gltf.scene.traverse((object) => {
    if (!(object instanceof Mesh)) return;
    const material = object.material as MeshStandardMaterial;
    const index = associations.get(material)?.materials;
    const gloss = json.materials?.[index ?? -1]?.extensions?.KHR_materials_pbrSpecularGlossiness;
    if (gloss) materials.set(material, gloss);
  });
  const textureOf = (info: GltfTextureInfo) => gltf.parser.assignTexture({}, 'map', info, SRGBColorSpace);
  await Promise.all([...materials].map(([material, gloss]) => readSpecularGlossiness(material, gloss, textureOf)));
}

function place(object: Object3D, node: GltfNode): void {
  object.position.set(...(node.translation ?? [0, 0, 0]));
  object.quaternion.set(...(node.rotation ?? [0, 0, 0, 1]));
  object.scale.set(...(node.scale ?? [1, 1, 1]));
  object.updateMatrixWorld(true);
}
