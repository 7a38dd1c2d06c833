// Loads the scene of this folder with its lightmaps. For your own page: copy this file, scene.glb, lighting.json and
// the lightmaps, and call loadLitScene(). Tested with PlayCanvas 2.23.
import { ADDRESS_CLAMP_TO_EDGE, Asset, FILTER_LINEAR } from 'playcanvas';

function load(app, asset) {
  return new Promise((resolve, reject) => {
    asset.ready(() => resolve(asset.resource));
    asset.once('error', (message) => reject(new Error(`${asset.name}: ${message}`)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
}

async function loadLightMap(app, { file }, folder) {
  const texture = await load(app, new Asset(file, 'texture', { url: new URL(file, folder).href }));
  texture.addressU = texture.addressV = ADDRESS_CLAMP_TO_EDGE;
  texture.minFilter = texture.magFilter = FILTER_LINEAR;
  return texture;
}

/**
 * Returns the scene's entity, which is not yet in the hierarchy, and the `exposure` for app.scene. PlayCanvas
 * multiplies a lightMap by the surface's colour, without a division by pi, and has no factor for it. So luminances come
 * in units of luxOfOne / pi nits, and emission is brought to these. Lamps that are in the lightmaps are not in the
 * scene. Lights that you add shine in addition. Glass shows what is behind it only to cameras that were told to keep
 * that: camera.requestSceneColorMap(true).
 *
 * @param app a pc.Application, or a pc.AppBase that has the handlers of textures and containers
 * @param {string} folder URL of the folder with the files; unless stated, that of this script
 */
export async function loadLitScene(app, folder = new URL('.', import.meta.url).href) {
  const base = new URL(folder.replace(/\/?$/, '/'), document.baseURI);
  const answer = await fetch(new URL('lighting.json', base));
  if (!answer.ok) throw new Error(`${answer.url}: ${answer.status} ${answer.statusText}`);
  const about = await answer.json();
  const lightMaps = await Promise.all(about.lightmaps.map((page) => loadLightMap(app, page, base)));
  const luxOfOne = about.lightmaps[0]?.luxOfOne ?? 1; // all pages share it
  const postprocess = (gltf, material) => {
    material.emissiveIntensity *= Math.PI / luxOfOne;
    const page = gltf.extras?.lightmap;
    if (!(page in lightMaps)) return;
    material.lightMap = lightMaps[page];
    material.lightMapUv = 1; // TEXCOORD_1
    material.lightMapChannel = 'rgb';
  };
  const url = new URL(about.scene, base).href;
  const scene = await load(app, new Asset(about.scene, 'container', { url }, null, { material: { postprocess } }));
  const entity = scene.instantiateRenderEntity();
  return { entity, exposure: (about.exposure * luxOfOne) / Math.PI, about };
}
