// A browser that draws no WebGL 2.

import { Pages, SCENES, serveEach } from './harness';

const { serve } = serveEach();

it('says why nothing is to be seen, where the progress is, and asks the server for nothing more', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const pages = new Pages();
  await pages.launch(['--disable-3d-apis']);
  try {
    const page = await pages.open(server.url, 800, 600);
    await page.getByRole('heading', { name: 'The viewer could not start' }).waitFor();
    expect(await page.getByRole('link', { name: 'status page' }).getAttribute('href')).toBe('/status');
    await page.waitForTimeout(1500); // two pauses between one attempt to connect and the next
    expect(await page.locator('.banner:not([hidden])').count()).toBe(0);
    const viewers = async () =>
      /radiosityd_viewers (\d+)/.exec(await (await fetch(`${server.url}/metrics`)).text())?.[1];
    expect(await viewers()).toBe('0');
    // What went wrong, and nothing that follows from it.
    expect(pages.complaints.filter((text) => !/WebGL/.test(text))).toEqual([]);
  } finally {
    await pages.quit();
  }
});
