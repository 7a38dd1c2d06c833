// With the WebGL context goes all that three.js has made on the card, but not its listeners: an object that is disposed of
// later would delete things of a card that is gone, and keep the memory of them until then.

import { type BufferGeometry, type Material, type Mesh, type Object3D, Texture } from 'three';

/** Has three.js forget what it holds for these objects. Those that are drawn again are made again. */
export function release(root: Object3D): void {
  root.traverse((object) => {
    const { geometry, material } = object as Partial<Mesh>;
    (geometry as BufferGeometry | undefined)?.dispose();
    for (const one of material ? [material].flat() : []) releaseMaterial(one);
  });
}

function releaseMaterial(material: Material): void {
  for (const value of Object.values(material)) if (value instanceof Texture) value.dispose();
  material.dispose();
}
