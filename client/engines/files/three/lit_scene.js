// Loads the scene of this folder with its lightmaps. For your own page: copy this file, scene.glb, lighting.json and
// the lightmaps, and call loadLitScene(). Tested with
// three.js r187; before r155 a lightMap was no irradiance.
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
 * @param {string} folder URL of the folder with the files; unless stated, that of this script
 */
export async function loadLitScene(folder = new URL('.', import.meta.url).href) {
  const base = new URL(folder.replace(/\/?$/, '/'), document.baseURI);
  const answer = await fetch(new URL('lighting.json', base));
  if (!answer.ok) throw new Error(`${answer.url}: ${answer.status} ${answer.statusText}`);
  const about = await answer.json();
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
