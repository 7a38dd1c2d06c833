import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, said, serveAll, until } from './harness';

const { server, pages } = serveAll('cornell.glb');

const eye = (page: Page) => page.evaluate(() => window.viewer!.viewer.rig.camera.position.toArray());
/** Where a page draws the others' eyes. */
const others = (page: Page) =>
  page.evaluate(() => window.viewer!.people.people.root.children.map((person) => person.position.toArray()));
const distance = (a: readonly number[], b: readonly number[]) => Math.hypot(...a.map((v, i) => v - b[i]!));

/** Until a page shows one other, there. */
async function shows(page: Page, other: Page): Promise<void> {
  const off = async () => {
    const [all, goal] = [await others(page), await eye(other)];
    return all.length === 1 ? distance(all[0]!, goal) : Infinity;
  };
  expect(await until(off, (far) => far < 1e-3)).toBeLessThan(1e-3); // five digits are told
}

it('shows where the other looks from, follows, and forgets who leaves', async () => {
  const first = await pages.open(server.url, 1200, 800);
  await converged(first);
  const second = await pages.open(server.url, 1200, 800);
  await converged(second);
  await shows(first, second);
  await shows(second, first);

  await second.locator('canvas.view').focus();
  for (let i = 0; i < 12; ++i) await second.keyboard.press('ArrowRight');
  await shows(first, second);

  // A name in the picture leads there.
  for (let i = 0; i < 20; ++i) await first.keyboard.press('-');
  const name = first.locator('.person');
  await name.waitFor();
  await name.click();
  await until(
    async () => distance(await eye(first), await eye(second)),
    (d) => d < 1e-3,
  );
  expect(distance(await eye(first), await eye(second))).toBeLessThan(1e-3);
  // In one place with it, the sign would fill the picture.
  const visible = await until(
    () => name.isVisible(),
    (is) => !is,
  );
  expect(visible).toBe(false);

  await second.context().close();
  const left = await until(
    () => others(first),
    (all) => all.length === 0,
  );
  expect(left).toEqual([]);
});

it('shows nothing of who does not want it, and nothing to them', async () => {
  const first = await pages.open(server.url, 1200, 800);
  await converged(first);
  const second = await pages.open(server.url, 1200, 800);
  await converged(second);
  await shows(first, second);
  await second.getByRole('tab', { name: 'Share' }).click();
  await second.getByLabel('Share cameras').uncheck();
  const left = await until(
    () => others(first),
    (all) => all.length === 0,
  );
  expect(left).toEqual([]);
  expect(await others(second)).toEqual([]);
  // The choice outlives the visit.
  await second.reload();
  await converged(second);
  expect(await others(first)).toEqual([]);
  await second.getByRole('tab', { name: 'Share' }).click();
  expect(await second.getByLabel('Share cameras').isChecked()).toBe(false);
  await second.getByLabel('Share cameras').check();
  await shows(first, second);
  await shows(second, first);
});

it('calls people what they call themselves, from then on and on their next visit', async () => {
  const first = await pages.open(server.url, 1200, 800);
  await converged(first);
  const second = await pages.open(server.url, 1200, 800);
  await converged(second);
  await shows(first, second);
  const label = () => first.evaluate(() => window.viewer!.people.people.labels.textContent ?? '');
  expect(await label()).toMatch(/^viewer \w{4}$/);
  await second.getByRole('tab', { name: 'Share' }).click();
  const [panel, field] = [second.locator('#tab-Share'), second.getByLabel('Your name')];
  const [around, box] = [(await panel.boundingBox())!, (await field.boundingBox())!];
  expect(box.x + box.width).toBeLessThan(around.x + around.width);
  await field.fill('Ann Lee');
  await second.keyboard.press('Enter');
  expect(await until(label, (text) => text === 'Ann Lee')).toBe('Ann Lee');
  await second.evaluate(() =>
    window.viewer!.edit.document.edit('Colour', [
      { op: 'replace', path: '/materials/@white/pbrMetallicRoughness/baseColorFactor', value: [0.5, 0.6, 0.7, 1] },
    ]),
  );
  await said(first, /^Ann Lee changed white: colour$/);
  await converged(second);
  // The page that was given another name has gone on where it was.
  expect(await second.evaluate(() => window.notes!)).toEqual([]);
  await second.reload();
  await converged(second);
  await shows(first, second);
  expect(await until(label, (text) => text === 'Ann Lee')).toBe('Ann Lee');
});
