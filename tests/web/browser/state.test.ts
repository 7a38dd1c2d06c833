// What the page says of its server's state: what can be undone, and what has failed.

import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import type { Progress } from '../../../client/web/src/protocol/messages';
import { answered, converged, drawn, said, sceneOf, SCENES, type Server, serveEach, until } from './harness';

const { pages, serve } = serveEach();

const step = (page: Page, name: 'Undo' | 'Redo') => page.getByRole('button', { name, exact: true });

/** Until Undo and Redo can be pressed, or cannot, as given. */
async function offers(page: Page, undo: boolean, redo: boolean): Promise<void> {
  const offered = async () => [await step(page, 'Undo').isEnabled(), await step(page, 'Redo').isEnabled()];
  await until(offered, ([canUndo, canRedo]) => canUndo === undo && canRedo === redo);
}

const emissionOf = async (server: Server) =>
  (await sceneOf(server)).materials.find(({ name }) => name === 'light')!['emissiveFactor'] as number[];

it('offers to undo and to redo what there is, and says so where there is nothing', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  const before = await emissionOf(server);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  await said(page, /^Nothing to undo$/);
  await page.keyboard.press('Control+Shift+z');
  await said(page, /^Nothing to redo$/);
  await offers(page, false, false);

  // What a script has done can be taken back here, and made again.
  const value = [0.2, 0.4, 1];
  const patch = [{ op: 'replace', path: '/materials/@light/emissiveFactor', value }];
  const other = await pages.open(server.url);
  await other.waitForFunction(() => window.viewer?.connection.isOpen);
  await other.evaluate((p) => window.viewer!.connection.call('scene.patch', { patch: p }), patch);
  await offers(page, true, false);
  await page.keyboard.press('Control+z');
  await offers(page, false, true);
  expect(await emissionOf(server)).toEqual(before);
  await step(page, 'Redo').click();
  await offers(page, true, false);
  expect(await emissionOf(server)).toEqual(value);

  // What was done here is taken back once: to take that back, too, would be to do it again.
  await page.mouse.click(400, 260); // the back wall
  await page.getByLabel('Colour', { exact: true }).fill('#2040ff');
  await answered(page);
  await offers(page, true, false);
  const blue = (await sceneOf(server)).materials;
  await step(page, 'Undo').click();
  await answered(page);
  await offers(page, false, true);
  const back = (await sceneOf(server)).materials;
  expect(back).not.toEqual(blue);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  const twice = () => page.evaluate(() => window.notes!.filter((text) => text === 'Nothing to undo').length);
  expect(await until(twice, (count) => count === 2)).toBe(2);
  expect((await sceneOf(server)).materials).toEqual(back);

  // Nor by pressing twice, faster than the server answers.
  await page.getByLabel('Colour', { exact: true }).fill('#ff4020');
  await answered(page);
  const red = (await sceneOf(server)).materials;
  expect(red).not.toEqual(back);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  await page.keyboard.press('Control+z');
  expect(await until(twice, (count) => count === 3)).toBe(3);
  expect((await sceneOf(server)).materials).toEqual(back);

  // Another process knows nothing of it.
  await server.stop();
  await page.getByText(/No connection/).waitFor();
  await server.start();
  await converged(page);
  await offers(page, false, false);
});

/** A page on whose connection a test has a word to say: it changes what comes, and tells more. */
async function openTold(
  url: string,
  change: (text: string) => string = (text) => text,
): Promise<{ page: Page; tell: (message: object) => void }> {
  const page = await pages.open('about:blank', 900, 600);
  let send = (_text: string) => undefined as void;
  // A server that has failed says no more of what it did before, until it is asked to solve again: ours, which is well,
  // may still measure.
  let over = -1;
  const isOver = (text: string) => {
    const { method, params } = JSON.parse(text) as {
      method?: string;
      params?: Progress;
    };
    return method === 'progress' && params!.revision <= over;
  };
  await page.routeWebSocket(/\/ws$/, (socket) => {
    const upstream = socket.connectToServer();
    socket.onMessage((message) => {
      if (String(message).includes('"solve.')) over = -1;
      upstream.send(message);
    });
    upstream.onMessage((message) => {
      if (typeof message !== 'string') socket.send(message);
      else if (!isOver(message)) socket.send(change(message));
    });
    send = (text) => socket.send(text);
  });
  await page.goto(url);
  const tell = (message: { params?: object }) => {
    const params = message.params as Partial<Progress> | undefined;
    if (params?.state === 'failed') over = params.revision ?? -1;
    send(JSON.stringify({ jsonrpc: '2.0', ...message }));
  };
  return { page, tell };
}

/** As a server tells it when it has no memory left, which a test cannot take from it. */
const failed = (progress: Progress, surfaces: number) => ({
  method: 'progress',
  params: {
    ...progress,
    state: 'failed',
    failure: 'out of memory (bad_alloc)',
    surfaces,
    patches: 100 * surfaces,
  },
});

const told = (page: Page) => page.evaluate(() => window.viewer!.progress!);

it('does not go on showing a scene that its server has lost, and says why', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const { page, tell } = await openTold(server.url);
  await converged(page);
  tell(failed(await told(page), 0));
  const card = page.locator('.welcome');
  await card.getByText('The server has lost the scene').waitFor();
  await card.getByText('Reason: out of memory (bad_alloc).').waitFor();
  expect(await page.locator('.chip').innerText()).toBe('Failed');
  await drawn(page);
  expect(await page.evaluate(() => window.viewer!.viewer.shown)).toBeUndefined();
  expect(await page.evaluate(() => window.viewer!.edit.document.gltf.nodes)).toBeUndefined();
  // Until there is one again.
  const glb = await (await fetch(`${server.url}/scene.glb`)).arrayBuffer();
  await fetch(`${server.url}/scene?name=again.glb`, {
    method: 'PUT',
    body: glb,
  });
  await converged(page);
  expect(await card.isVisible()).toBe(false);
});

it('says what failed to who comes after it', async () => {
  const server = await serve();
  const { page } = await openTold(server.url, (text) =>
    text.replaceAll('"state":"empty"', '"state":"failed","failure":"out of memory (bad_alloc)"'),
  );
  await page.locator('.welcome').getByText('Reason: out of memory (bad_alloc).').waitFor();
  expect(await page.locator('.chip').innerText()).toBe('Failed');
  const other = await serve(`${SCENES}/cornell.glb`);
  const glb = await (await fetch(`${other.url}/scene.glb`)).arrayBuffer();
  await fetch(`${server.url}/scene?name=room.glb`, {
    method: 'PUT',
    body: glb,
  });
  await converged(page);
  expect(await page.locator('.welcome').isVisible()).toBe(false);
});

it('keeps the light of a solve that has failed, says why, and starts it again', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const { page, tell } = await openTold(server.url);
  await converged(page);
  const { surfaces } = await told(page);
  tell(failed(await told(page), surfaces));
  const banner = page.locator('.banner');
  await banner.getByText('The solve failed: out of memory (bad_alloc).').waitFor();
  expect(await page.evaluate(() => window.viewer!.viewer.shown !== undefined)).toBe(true);
  expect(await page.locator('.welcome').isVisible()).toBe(false);
  await banner.getByRole('button', { name: 'Restart' }).click();
  await converged(page);
  expect(await banner.isVisible()).toBe(false);
});

it('says that nothing shines, and offers a lamp', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url);
  await converged(page);
  const banner = page.locator('.banner');
  expect(await banner.isVisible()).toBe(false);
  await page.evaluate(() =>
    window.viewer!.connection.call('scene.patch', {
      patch: [
        {
          op: 'replace',
          path: '/materials/@light/emissiveFactor',
          value: [0, 0, 0],
        },
      ],
    }),
  );
  await banner.getByText('Nothing shines in this scene').waitFor();
  await banner.getByRole('button', { name: 'Add a lamp' }).click();
  await banner.waitFor({ state: 'hidden' });
  await converged(page);
  expect(await banner.isVisible()).toBe(false);
  expect((await told(page)).energy['emitted']).toBeGreaterThan(0);
});

it('does not call good what has stopped short of its target', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const tell = (state: Progress['state']) =>
    page.evaluate((state) => {
      const { progress, solve } = window.viewer!;
      solve.onProgress({ ...progress!, state });
    }, state);
  const dot = () => page.evaluate(() => document.querySelector('.chip .dot')!.className);
  for (const [state, shown] of [
    ['limited', 'short'],
    ['converged', 'good'],
    ['timeLimit', 'short'],
  ] as const) {
    // What the server goes on to measure may be told between: so often as it takes.
    const told = async () => {
      await tell(state);
      return dot();
    };
    await until(told, (name) => name === `dot ${shown}`);
  }
});

it('does not take the black before the last tiles for the light of a solve that is over', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  await converged(await pages.open(server.url));
  const page = await pages.open('about:blank', 900, 600);
  let held: (() => void)[] | undefined = [];
  await page.routeWebSocket(/\/ws$/, (socket) => {
    const upstream = socket.connectToServer();
    socket.onMessage((message) => upstream.send(message));
    upstream.onMessage((message) => {
      const isLight = typeof message !== 'string' || message.includes('"method":"bookmark"');
      if (isLight && held) held.push(() => socket.send(message));
      else socket.send(message);
    });
  });
  await page.goto(server.url);
  await page.waitForFunction(() => {
    const { progress, viewer } = window.viewer ?? {};
    return progress?.state === 'converged' && viewer?.set !== undefined;
  });
  await drawn(page);
  expect(held.length).toBeGreaterThan(0);
  expect(await page.evaluate(() => window.viewer!.viewer.set!.lit)).toBe(false);
  for (const send of held) send();
  held = undefined;
  await converged(page);
  // With the next frame, once the exposure is told.
  await page.waitForFunction(() => window.viewer!.viewer.shown!.set.showsLight);
});

it('says that a solve which is over is done when the errors of its end are here, too', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  await converged(await pages.open(server.url));
  const page = await pages.open('about:blank', 900, 600);
  let held: (() => void)[] = [];
  let holds = false;
  await page.routeWebSocket(/\/ws$/, (socket) => {
    const upstream = socket.connectToServer();
    socket.onMessage((message) => upstream.send(message));
    upstream.onMessage((message) => {
      if (holds && typeof message === 'string' && message.includes('"method":"bookmark"'))
        held.push(() => socket.send(message));
      else socket.send(message);
    });
  });
  await page.goto(server.url);
  await converged(page);
  const chip = () => page.locator('.chip .state').innerText();
  await until(chip, (text) => text === 'Done'); // its last tiles may be on their way
  holds = true;
  await page.evaluate(() => window.viewer!.view.setMode('error'));
  await until(async () => held.length, (count) => count > 0); // prettier-ignore
  await drawn(page);
  await until(chip, (text) => text === 'Receiving light');
  holds = false;
  for (const send of held) send();
  held = [];
  await until(chip, (text) => text === 'Done');
});

it('undoes on past what somebody else has undone, and lets go of what is no more', async () => {
  const server = await serve(`${SCENES}/cornell.glb`);
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  const before = await emissionOf(server);
  await page.evaluate(() => {
    const { document } = window.viewer!.edit;
    const value = [0.2, 0.4, 1];
    return document.edit('Colour', [{ op: 'replace', path: '/materials/@light/emissiveFactor', value }]);
  });
  await page
    .getByRole('button', { name: /Add a lamp/ })
    .first()
    .click();
  await answered(page);
  await page.waitForFunction(() => window.viewer!.edit.selection !== undefined);
  const lamps = (await sceneOf(server)).nodes.length;
  const other = await pages.open(server.url);
  await other.waitForFunction(() => window.viewer?.connection.isOpen);
  await other.evaluate(() => window.viewer!.connection.call('scene.undo', {}));
  await until(
    async () => (await sceneOf(server)).nodes.length,
    (count) => count < lamps,
  );
  await page.waitForFunction(() => window.viewer!.edit.selection === undefined);

  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  await said(page, /^Undo Add lamp: /);
  await page.keyboard.press('Control+z');
  expect(
    await until(
      () => emissionOf(server),
      (value) => value.join() === before.join(),
    ),
  ).toEqual(before);
});

it('plots the whole of a solve, also where the page came when all was done, and begins anew with the next', async () => {
  const server = await serve(`${SCENES}/cornell.glb`, '--error', '0.004');
  const early = await pages.open(server.url);
  await converged(early);
  const late = await pages.open(server.url);
  await converged(late);
  const samplesOf = (page: Page) => page.evaluate(() => [...window.viewer!.solve.panel.plot.drawn]);
  const [first, ...more] = await until(
    () => samplesOf(late),
    (samples) => samples.length > 1,
  );
  const end = await late.evaluate(() => window.viewer!.progress!);
  const times = [first!, ...more].map(({ seconds }) => seconds);
  expect(times).toEqual([...times].sort((a, b) => a - b));
  expect(times.at(-1)).toBe(end.seconds);
  expect(more.at(-1)!.total).toBe(end.error.total);
  expect(first!.total).toBeGreaterThan(2 * end.error.total);
  // Of what both have seen they say the same.
  const seen = new Map((await samplesOf(early)).map(({ seconds, total }) => [seconds, total]));
  expect(more.some(({ seconds, total }) => seen.get(seconds) === total)).toBe(true);
  await late.evaluate(() => window.viewer!.connection.call('solve.restart'));
  await until(
    () => samplesOf(late),
    (samples) => samples.length > 0 && samples.every(({ seconds }) => !times.includes(seconds)),
  );
});
