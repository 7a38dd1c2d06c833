// What rays meet, against three.js's own search of all triangles.

import {
  BoxGeometry,
  DoubleSide,
  Group,
  Mesh,
  MeshStandardMaterial,
  Raycaster,
  TorusKnotGeometry,
  Vector3,
} from 'three';
import { LitMaterial, ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import type { LitScene } from '../../../client/web/src/view/scene/lit_scene';
import { RayTree } from '../../../client/web/src/view/rays/ray_tree';

const lit = (change: (source: MeshStandardMaterial) => void = () => undefined) => {
  const source = new MeshStandardMaterial();
  change(source);
  return new LitMaterial(source, new ViewUniforms(), undefined);
};

/** Numbers from 0 to 1, the same in every run. */
function* chance(): Generator<number, never> {
  for (let state = 1; ; ) yield (state = (state * 48271) % 2147483647) / 2147483647;
}

const scene = (...meshes: Mesh[]) =>
  ({ root: meshes.reduce((root, mesh) => root.add(mesh), new Group()) }) as unknown as LitScene;

it('meets first what a search of all triangles meets first, from the sides that are drawn', () => {
  const knot = new Mesh(new TorusKnotGeometry(1, 0.3, 200, 24), lit());
  const box = new Mesh(
    new BoxGeometry(1, 2, 3),
    lit((source) => (source.side = DoubleSide)),
  );
  knot.position.set(0.5, -0.25, 1);
  knot.scale.set(-1, 1.5, 1); // mirrored: its front stays outside
  box.rotation.set(0.3, 0.7, 0.1);
  const all = scene(knot, box);
  const tree = new RayTree(all);
  const next = chance();
  const within = (size: number) => new Vector3(...[0, 1, 2].map(() => size * (next.next().value - 0.5)));
  let [hits, backs] = [0, 0];
  for (let i = 0; i < 500; ++i) {
    const [from, direction] = [within(6), within(1).normalize()];
    const first = new Raycaster(from, direction).intersectObject(all.root)[0];
    const found = tree.cast(from, direction, 'drawn', 0);
    expect(found?.mesh).toBe(first?.object);
    if (!found || !first) continue;
    ++hits;
    expect(found.distance).toBeCloseTo(first.distance, 9);
    expect(found.normal.dot(direction)).toBeLessThan(0);
    if (found.mesh === box && from.clone().applyMatrix4(box.matrixWorld.clone().invert()).length() < 0.5) ++backs;
  }
  expect(hits).toBeGreaterThan(50);
  expect(backs).toBeGreaterThan(0);
});

it('lets light through what is seen through, and through no backs', () => {
  const glass = new Mesh(
    new BoxGeometry(4, 4, 0.1),
    lit((source) => (source.transparent = true)),
  );
  const crate = new Mesh(new BoxGeometry(1, 1, 1), lit());
  glass.position.z = 2;
  const tree = new RayTree(scene(glass, crate));
  const ahead = new Vector3(0, 0, -1);
  expect(tree.cast(new Vector3(0, 0, 5), ahead, 'drawn', 0)?.distance).toBeCloseTo(2.95, 6);
  expect(tree.cast(new Vector3(0, 0, 5), ahead, 'solid', 0)?.distance).toBeCloseTo(4.5, 9);
  expect(tree.cast(new Vector3(0, 0, 0), ahead, 'drawn', 0)).toBeUndefined();
  expect(tree.cast(new Vector3(0, 0, 0), ahead, 'solid', 0)?.distance).toBeCloseTo(0.5, 9);
  expect(tree.cast(new Vector3(0, 0, 5), ahead, 'solid', 0, 4.4)).toBeUndefined();
});

it('holds nothing, and thousands of triangles in one place', () => {
  expect(new RayTree(scene()).cast(new Vector3(), new Vector3(0, 0, 1), 'drawn', 0)).toBeUndefined();
  const boxes = Array.from({ length: 500 }, () => new Mesh(new BoxGeometry(1, 1, 1), lit()));
  const hit = new RayTree(scene(...boxes)).cast(new Vector3(0, 0, 3), new Vector3(0, 0, -1), 'drawn', 0);
  expect(hit?.distance).toBeCloseTo(2.5, 9);
});
