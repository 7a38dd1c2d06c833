// Measuring planes: added, measured, judged and moved in the viewer.

import type {} from '../../../client/web/src/main';
import { converged, drawn, serveEach, until, SCENES } from './harness';

const { serve, pages } = serveEach();

it('adds a plane over the floor, measures it, says whether it is bright enough, and forgets what is old', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  await page.getByRole('tab', { name: 'Measure' }).click();
  await page.getByRole('button', { name: 'Add plane' }).click();
  const count = () => page.evaluate(() => (window.viewer!.edit.document.gltf.nodes ?? []).length);
  const node = (await count()) - 1;
  const plane = () =>
    page.evaluate(
      (n) => (window.viewer!.edit.document.gltf.nodes![n]!.extras as { radiosityPlane?: object })?.radiosityPlane,
      node,
    );
  expect(await until(plane, (it) => it !== undefined)).toMatchObject({ width: expect.any(Number) as number });
  await page.getByRole('tab', { name: 'Measure' }).click(); // what is selected brings its own panel to the front
  await page.getByLabel('Wanted mean, lx').fill('0.001');
  await page.getByLabel('Wanted mean, lx').press('Enter');
  await until(plane, (it) => 'target' in it!);
  await page.getByLabel('Wanted mean, lx').blur();
  await page.getByRole('button', { name: 'Measure', exact: true }).click();
  const text = () => page.locator('[role=tabpanel]:not([hidden])').innerText();
  const measured = await until(text, (it) => it.includes('(95 %)'));
  expect(measured).toMatch(/[\d.]+ ± [\d.]+ lx, minimum [\d.]+, maximum [\d.]+, U0 [01]\.\d\d/);
  expect(measured).toContain('0.001 lx: passes');
  const painted = () =>
    page.evaluate((n) => {
      const marker = window.viewer!.viewer.shown!.planes.get(n);
      let seen = false;
      marker?.traverse((part) => (seen ||= (part as { isMesh?: boolean }).isMesh === true && part.visible));
      return seen;
    }, node);
  expect(await until(painted, (it) => it)).toBe(true);
  await drawn(page);
  const file = process.env['RADIOSITY_PICTURE'];
  if (file) await page.screenshot({ path: file });

  const saved = page.waitForEvent('download');
  await page.getByRole('button', { name: 'Download CSV' }).click();
  expect((await saved).suggestedFilename()).toBe('planes.csv');

  // Elsewhere its light is another.
  await page.evaluate(
    (n) =>
      window.viewer!.connection.call('scene.patch', {
        patch: [{ op: 'replace', path: `/nodes/${n}/translation`, value: [0.3, 0.2, 0.3] }],
      }),
    node,
  );
  expect(await until(painted, (it) => !it)).toBe(false);
  expect(await until(text, (it) => it.includes('has changed'))).toContain('since these were measured');
});
