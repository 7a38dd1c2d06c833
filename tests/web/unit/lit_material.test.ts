// Of faces that lie on each other the one that emits is drawn before the others, as the server lights them.

import { Color, MeshStandardMaterial } from 'three';
import { LitMaterial, ViewUniforms } from '../../../client/web/src/view/scene/lit_material';

function glowing(emits?: boolean): LitMaterial {
  const source = new MeshStandardMaterial({ emissive: new Color(1, 1, 1), emissiveIntensity: 100 });
  return new LitMaterial(source, new ViewUniforms(), undefined, emits);
}

it('comes before others where it emits', () => {
  expect(glowing().polygonOffset).toBe(true);
  expect(new LitMaterial(new MeshStandardMaterial(), new ViewUniforms(), undefined).polygonOffset).toBe(false);
});

it('does not where its emissive texture is black, whatever its factor becomes', () => {
  const dark = glowing(false);
  expect(dark.polygonOffset).toBe(false);
  dark.edit({ emissiveFactor: [0.5, 0.5, 0.5] });
  expect(dark.polygonOffset).toBe(false);
});
