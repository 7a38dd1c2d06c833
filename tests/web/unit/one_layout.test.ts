import { fetchLightmaps, fetchLitScene, type Layouts } from '../../../client/web/src/document/one_layout';
import type { LightmapsNote } from '../../../client/web/src/protocol/messages';

const note = (layout: number, pages: number): LightmapsNote => ({
  layout,
  revision: layout,
  pages: Array.from({ length: pages }, () => ({ width: 64, height: 64, mips: 7 })),
  uvs: `/scene.glb?layout=${layout}`,
});

/** A server whose layout changes before those of its answers that `edits` names, counted from 0. */
function server(edits: (request: number) => boolean, pagesOf = (_layout: number) => 3) {
  let layout = 1;
  let told = note(1, pagesOf(1));
  let pauses = 0;
  const asked: string[] = [];
  const layouts: Layouts = {
    now: () => told,
    fetch: async (path, init) => {
      if (edits(asked.length)) ++layout;
      asked.push(`${init?.method ?? 'GET'} ${path}`);
      const wanted = /layout=(\d+)$/.exec(path)?.[1];
      if (wanted !== undefined && Number(wanted) !== layout) return new Response(null, { status: 204 });
      const page = /(\d+)\.exr$/.exec(path)?.[1];
      if (Number(page) >= pagesOf(layout)) throw new Error('no such page');
      return new Response(
        init?.method === 'HEAD' ? null : `${page === undefined ? 'scene' : `page ${page}`} of ${layout}`,
      );
    },
    pause: async () => {
      if (++pauses % 3 === 0) told = note(layout, pagesOf(layout)); // its message takes its time
    },
  };
  return { layouts, asked, pauses: () => pauses };
}

const texts = (blobs: Blob[]) => Promise.all(blobs.map((blob) => blob.text()));

describe('what is downloaded', () => {
  it('is asked for once where nobody edits', async () => {
    const { layouts, asked, pauses } = server(() => false);
    expect(await (await fetchLitScene(layouts)).text()).toBe('scene of 1');
    expect(await texts(await fetchLightmaps(layouts))).toEqual(['page 0 of 1', 'page 1 of 1', 'page 2 of 1']);
    expect(asked.filter((request) => request.includes('exr')).length).toBe(3);
    expect(asked[0]).toBe('GET /scene.glb?layout=1');
    expect(pauses()).toBe(0);
  });

  it('is the scene of the next layout where that of the one shown is gone', async () => {
    const { layouts, asked } = server((request) => request === 0);
    expect(await (await fetchLitScene(layouts)).text()).toBe('scene of 2');
    expect(asked).toEqual(['GET /scene.glb?layout=1', 'GET /scene.glb?layout=2']);
  });

  it.each([1, 2, 3])('never mixes pages of two layouts: an edit before answer %i', async (when) => {
    const { layouts } = server((request) => request === when);
    expect(await texts(await fetchLightmaps(layouts))).toEqual(['page 0 of 2', 'page 1 of 2', 'page 2 of 2']);
  });

  it('has as many pages as the new layout', async () => {
    const { layouts } = server((request) => request === 2, (layout) => (layout === 1 ? 3 : 1)); // prettier-ignore
    expect(await texts(await fetchLightmaps(layouts))).toEqual(['page 0 of 2']);
  });

  it('is given up with a message where the layout changes all the time', async () => {
    const { layouts, asked } = server(() => true);
    await expect(fetchLightmaps(layouts)).rejects.toThrow(/kept changing/);
    await expect(fetchLitScene(layouts)).rejects.toThrow(/nobody is editing/);
    expect(asked.length).toBe(4 * 4 + 4);
  });

  it('says what the server says where the layout is still the same', async () => {
    const { layouts } = server(() => false, () => 3); // prettier-ignore
    const broken = { ...layouts, now: () => note(1, 4) };
    await expect(fetchLightmaps(broken)).rejects.toThrow('no such page');
  });

  it('needs light', async () => {
    const { layouts } = server(() => false);
    await expect(fetchLightmaps({ ...layouts, now: () => undefined })).rejects.toThrow(/no light/);
  });
});
