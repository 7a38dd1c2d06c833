// Loads the scene of this folder with its lightmaps. For your own page: copy this file, scene.glb, lighting.json and
// the lightmaps, and call loadLitScene(). Tested with
// Babylon.js 9.28.

/**
 * Babylon adds a lightmap to the picture as it is, or multiplies all other light by it. A lightmap of irradiance is
 * light that arrives: the surface's own colour goes with it, divided by pi, and lights that you add shine in addition.
 */
function makeIrradianceLightmap(B) {
  return class IrradianceLightmap extends B.MaterialPluginBase {
    constructor(material) {
      super(material, 'IrradianceLightmap', 200, {}, true, true);
    }
    getClassName() {
      return 'IrradianceLightmap';
    }
    isCompatible() {
      return true; // the code below is right in GLSL and in WGSL
    }
    getCustomCode(shader) {
      if (shader !== 'fragment') return null;
      return {
        CUSTOM_FRAGMENT_BEFORE_FINALCOLORCOMPOSITION: `
          #if defined(LIGHTMAP)
            finalAmbient = finalAmbient + surfaceAlbedo * lightmapColor.rgb * 0.318309886;
            lightmapColor = lightmapColor * 0.0;
          #endif
        `,
      };
    }
  };
}

function loadLightmap(B, scene, { file, luxOfOne }, folder) {
  return new Promise((resolve, reject) => {
    const loaded = () => {
      texture.gammaSpace = false; // which the loader takes to be unknown
      resolve(texture);
    };
    const settle = [loaded, (message) => reject(new Error(message ?? `${file} cannot be loaded`))];
    const url = new URL(file, folder).href;
    const texture = new B.Texture(url, scene, true, false, B.Texture.BILINEAR_SAMPLINGMODE, ...settle);
    texture.coordinatesIndex = 1; // TEXCOORD_1
    [texture.vScale, texture.vOffset] = [-1, 1]; // Babylon's EXR loader has the last row first, and glTF's v runs down
    texture.wrapU = texture.wrapV = B.Texture.CLAMP_ADDRESSMODE;
    texture.level = luxOfOne;
  });
}

/**
 * Fills `scene`; luminances are in nits, so set imageProcessingConfiguration.exposure to the `exposure` that is
 * returned. Lamps that are in the lightmaps are not in the scene; their nodes tell what they were in
 * metadata.gltf.extras.bakedLight.
 *
 * @param {string} folder URL of the folder with the files; unless stated, that of this script
 * @param B the names of Babylon.js: the global of its scripts, or those you import from @babylonjs/core
 */
export async function loadLitScene(scene, folder = new URL('.', import.meta.url).href, B = globalThis.BABYLON) {
  const base = new URL(folder.replace(/\/?$/, '/'), document.baseURI);
  const answer = await fetch(new URL('lighting.json', base));
  if (!answer.ok) throw new Error(`${answer.url}: ${answer.status} ${answer.statusText}`);
  const about = await answer.json();
  const [container, ...lightmaps] = await Promise.all([
    // 0: no animation starts by itself. The light is that of the pose at rest.
    B.LoadAssetContainerAsync(new URL(about.scene, base).href, scene, {
      pluginOptions: { gltf: { animationStartMode: 0 } },
    }),
    ...about.lightmaps.map((page) => loadLightmap(B, scene, page, base)),
  ]);
  const IrradianceLightmap = makeIrradianceLightmap(B);
  for (const material of container.materials) {
    const page = material.metadata?.gltf?.extras?.lightmap;
    if (!(page in lightmaps)) continue;
    new IrradianceLightmap(material);
    material.lightmapTexture = lightmaps[page];
  }
  container.addAllToScene();
  return { container, exposure: about.exposure, about };
}
