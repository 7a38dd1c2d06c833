// When the WebGL context is lost, all that three.js has made on the card is gone, but three.js does not know: objects
// that are disposed of later would delete things of a lost card, and keep their memory until then.

import { type BufferGeometry, type Material, type Mesh, type Object3D, Texture } from 'three';

/** Makes three.js forget what it has made for these objects. It makes it again when they are drawn again. */
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
