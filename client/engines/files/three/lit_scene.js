// Loads the scene of this folder with its lightmaps. For your own page: copy this file, scene.glb, lighting.json and
// the lightmaps, and call loadLitScene(). Needs three.js r155 or later, where a lightMap is irradiance.
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

async function loadLightMap({ file }, folder) {
  const texture = await new EXRLoader().loadAsync(new URL(file, folder).href);
  texture.flipY = true; // the loader has the last row first, and glTF's v runs down
  texture.channel = 1; // TEXCOORD_1
  return texture;
}

/**
 * What GLTFLoader gives ({ scene, cameras, ... }), lit: luminances are in nits, so set the renderer's
 * toneMappingExposure to `exposure`, which comes with it. Lamps that are in the lightmaps are not in the scene; their
 * nodes tell what they were in userData.bakedLight. Lights that you add shine in addition.
 *
 * @param {string} folder where the files are
 */
export async function loadLitScene(folder = import.meta.url) {
  const base = new URL(folder, document.baseURI);
  const about = await (await fetch(new URL('lighting.json', base))).json();
  const [gltf, ...lightMaps] = await Promise.all([
    new GLTFLoader().loadAsync(new URL(about.scene, base).href),
    ...about.lightmaps.map((page) => loadLightMap(page, base)),
  ]);
  gltf.scene.traverse((object) => {
    for (const material of [object.material ?? []].flat()) {
      const page = material.userData.lightmap;
      if (!(page in lightMaps)) continue;
      material.lightMap = lightMaps[page];
      material.lightMapIntensity = about.lightmaps[page].luxOfOne;
    }
  });
  return { ...gltf, exposure: about.exposure, about };
}
