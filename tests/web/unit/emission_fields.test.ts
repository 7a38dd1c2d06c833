import type { GltfMaterial, Vec3 } from '../../../client/web/src/document/gltf';
import { emissionFields, emissionWritten } from '../../../client/web/src/ui/emission_fields';

const glowing = (emissiveFactor: Vec3, emissiveStrength: number): GltfMaterial => ({
  emissiveFactor,
  extensions: { KHR_materials_emissive_strength: { emissiveStrength } },
});

describe('the fields of an emission', () => {
  const blue = glowing([0.2, 0.5, 1], 17.1234567);
  const dim = glowing([0.1, 0.25, 0.5], 4);

  it('show a colour as bright as can be, and nits apart', () => {
    expect(emissionFields(blue)).toEqual({ colour: '#7cbcff', nits: '17.123' });
    expect(emissionFields(dim)).toEqual({ colour: '#7cbcff', nits: '2' });
    expect(emissionFields({})).toEqual({ colour: '#ffffff', nits: '0' });
  });

  it('keep the exact colour when the strength is written', () => {
    const nits = (material: GltfMaterial, text: string) =>
      emissionWritten(material, { ...emissionFields(material), nits: text });
    expect(nits(blue, '20')).toEqual({ factor: [0.2, 0.5, 1], strength: 20 });
    expect(nits(dim, '3')).toEqual({ factor: [0.1, 0.25, 0.5], strength: 6 });
    expect(nits(dim, '0')).toEqual({ factor: [0.1, 0.25, 0.5], strength: 0 });
  });

  it('keep the exact strength when a colour is chosen', () => {
    const chosen = (material: GltfMaterial, colour: string) =>
      emissionWritten(material, { ...emissionFields(material), colour });
    expect(chosen(blue, '#ff0000')).toEqual({ factor: [1, 0, 0], strength: 17.1234567 });
    expect(chosen(dim, '#ff0000')).toEqual({ factor: [1, 0, 0], strength: 2 });
    expect(chosen(blue, emissionFields(blue).colour)).toEqual({ factor: [0.2, 0.5, 1], strength: 17.1234567 });
  });

  it('make a lamp of what has none, in the colour that is shown', () => {
    expect(emissionWritten({}, { colour: '#ffffff', nits: '5' })).toEqual({ factor: [1, 1, 1], strength: 5 });
    expect(emissionWritten({}, { colour: '#00ff00', nits: '5' })).toEqual({ factor: [0, 1, 0], strength: 5 });
    expect(emissionWritten({}, { colour: '#00ff00', nits: '0' })).toMatchObject({ factor: [0, 0, 0], strength: 1 });
    const off = glowing([0.2, 0.5, 1], 0);
    expect(emissionWritten(off, { ...emissionFields(off), nits: '8' })).toEqual({ factor: [0.2, 0.5, 1], strength: 8 });
  });

  it('refuse a strength that is none', () => {
    for (const nits of ['bright', '-1', '']) expect(emissionWritten(blue, { colour: '#ffffff', nits })).toBeUndefined();
  });
});
