// Where one looks from at first, in scenes of more triangles than a search of all of them would have time for.

import {
  Box3,
  BoxGeometry,
  Color,
  Group,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  PlaneGeometry,
  Vector3,
} from 'three';
import { insideView } from '../../../client/web/src/view/rays/first_view';
import { LampMarker } from '../../../client/web/src/view/scene/lamp_marker';
import { LitMaterial, ViewUniforms } from '../../../client/web/src/view/scene/lit_material';
import type { LitScene } from '../../../client/web/src/view/scene/lit_scene';

const CELLS = 60; // 6 x 60 x 60 x 2 triangles of each box

function material(nits = 0): LitMaterial {
  const source = new MeshStandardMaterial({ emissive: new Color(nits > 0 ? 1 : 0, 0, 0), emissiveIntensity: nits });
  return new LitMaterial(source, new ViewUniforms(), undefined);
}

function box(size: Vector3, middle: Vector3, inward = false): Mesh {
  const geometry = new BoxGeometry(...size.toArray(), CELLS, CELLS, CELLS);
  if (inward) geometry.scale(-1, 1, 1); // turns it inside out
  return new Mesh(geometry.translate(...middle.toArray()), material());
}

const ROOM = new Box3(new Vector3(-2, 0, -1.5), new Vector3(2, 2.5, 1.5));

/** A room in a closed house on a lawn, with a lamp on its ceiling where there is one. */
function house(change: { lamp?: boolean; sun?: boolean } = {}): LitScene {
  const root = new Group().add(
    box(ROOM.getSize(new Vector3()), ROOM.getCenter(new Vector3()), true),
    box(new Vector3(8, 4, 6), new Vector3(1, 2, 0)),
    box(new Vector3(1, 0.8, 1), new Vector3(0.5, 0.4, 0.3)),
    new Mesh(new PlaneGeometry(40, 40).rotateX(-Math.PI / 2).translate(0, -0.01, 0), material()),
  );
  const lamp = new Mesh(new PlaneGeometry(0.6, 0.6).rotateX(Math.PI / 2).translate(0, 2.49, 0), material(1000));
  if (change.lamp !== false) root.add(lamp);
  const lamps = new Map<number, LampMarker>();
  if (change.sun) {
    const sun = new LampMarker(9);
    sun.rotation.x = -1; // downwards, and away from who looks from in front
    sun.display({ light: { type: 'directional' }, outline: [], selected: false }, 1);
    sun.position.set(0, 1, 0); // wherever it hangs
    sun.updateMatrixWorld();
    lamps.set(9, sun);
  }
  return {
    root,
    lamps,
    triangles: 3 * 12 * CELLS ** 2 + 4,
    bounds: new Box3().setFromObject(root),
  } as unknown as LitScene;
}

const outside = new PerspectiveCamera(45, 1, 0.1, 200);
outside.position.set(8, 12, 30);
outside.lookAt(0, 1, 0);

it('looks at a lit room in a closed house from inside, at the height of eyes', () => {
  const place = insideView(house(), outside)!;
  expect(ROOM.containsPoint(place.eye)).toBe(true);
  expect(place.eye.y).toBeGreaterThan(1);
  expect(place.eye.y).toBeLessThan(2);
  expect(place.eye.distanceTo(place.target)).toBeGreaterThan(1);
});

it('stays outside where the light is outside, or where there is none', () => {
  expect(insideView(house({ lamp: false }), outside)).toBeUndefined();
  expect(insideView(house({ lamp: false, sun: true }), outside)).toBeUndefined();
  expect(insideView(house({ sun: true }), outside)).toBeUndefined(); // of which more is lit than of the room
  expect(insideView(house(), outside, true)).toBeUndefined(); // under a sky
});
