// What the page says of what happens: notes that go by themselves, and what is wrong as long as it is.

import type {} from '../../../client/web/src/main';
import { converged, serveAll } from './harness';

const { server, pages } = serveAll('cornell.glb');

it('keeps what failed in sight while others do a lot, and puts what they go on with there once', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => (window.notes!.length = 0));
  await page.evaluate(() => {
    const { toasts } = window.viewer!.frame;
    toasts.show('Move box: would not be a scene', 'bad');
    for (let i = 0; i < 30; ++i) toasts.showOnce(`Ann changed box ${i}: position`);
    for (let i = 0; i < 30; ++i) {
      toasts.showOnce('Cid changed lamp: position');
      toasts.showOnce('Ben changed wall: colour');
    }
  });
  const texts = await page.locator('.toast span').allInnerTexts();
  expect(texts).toHaveLength(4);
  expect(texts).toContain('Move box: would not be a scene');
  expect(texts.at(-1)).toBe('Ben changed wall: colour');
  // Each that is put into the page is read out.
  expect(await page.evaluate(() => window.notes!.filter((text) => /^(Ben|Cid)/.test(text)))).toHaveLength(2);
  await page.evaluate(() => {
    for (let i = 0; i < 6; ++i) window.viewer!.frame.toasts.show(`Refusal ${i}`, 'bad');
  });
  expect(await page.locator('.toast.bad').count()).toBe(4);
});

it('shows names that would turn the text around them as what they are', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() =>
    window.viewer!.edit.onPatched({ revision: 0, patch: [], by: '\u202egnp.lla' }, () => undefined),
  );
  await page.evaluate(() => window.viewer!.edit.onPatched({ revision: 0, patch: [], by: ' \n ' }, () => undefined));
  const texts = await page.locator('.toast span').allTextContents();
  expect(texts).toEqual(['gnp.lla changed the scene', 'Someone changed the scene']);
});

it('says first what keeps one from all else, and the rest once that is mended', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const banner = page.locator('.banner');
  const set = (about: 'card' | 'solve' | 'link', text?: string) =>
    page.evaluate(({ about, text }) => window.viewer!.frame.setBanner(about, text), { about, text });
  await set('solve', 'The solve failed.');
  await page.evaluate(() => window.viewer!.frame.askToken('it is missing', () => undefined));
  await page.getByLabel('Token').fill('half of a tok');
  await set('card', 'The browser has lost the graphics card.');
  await set('card');
  expect(await page.getByLabel('Token').inputValue()).toBe('half of a tok');
  await set('card', 'The browser has lost the graphics card.');
  await set('link');
  expect(await banner.innerText()).toBe('The browser has lost the graphics card.');
  await set('card');
  expect(await banner.innerText()).toBe('The solve failed.');
  await set('solve');
  expect(await banner.isVisible()).toBe(false);
});
