// For those who see little, have no pointer, or a small screen.
import type { Page } from 'playwright-core';
import type {} from '../../../client/web/src/main';
import { converged, drawn, sceneOf, serveAll, turns, until } from './harness';

const { server, pages } = serveAll('cornell.glb');

const TABS = ['View', 'Solve', 'Scene', 'Share'];

/**
 * Texts that are less readable than WCAG 2.2 asks for (1.4.3, level AA: 4.5, or 3 where letters are large), with the
 * ratio. What shines through a card is taken as white, and as black. Disabled controls are exempt.
 */
async function unreadable(page: Page): Promise<string[]> {
  return page.evaluate(() => {
    type Colour = [number, number, number, number];
    const context = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true })!;
    const parse = (css: string): Colour => {
      context.clearRect(0, 0, 1, 1);
      context.fillStyle = css;
      context.fillRect(0, 0, 1, 1);
      const [r, g, b, a] = context.getImageData(0, 0, 1, 1).data;
      return [r!, g!, b!, a! / 255];
    };
    const over = (top: Colour, below: Colour): Colour => {
      const mix = (i: 0 | 1 | 2) => top[3] * top[i] + (1 - top[3]) * below[i];
      return [mix(0), mix(1), mix(2), 1];
    };
    const luminance = ([r, g, b]: Colour) => {
      const [x, y, z] = [r, g, b].map((v) => {
        const s = v / 255;
        return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
      });
      return 0.2126 * x! + 0.7152 * y! + 0.0722 * z!;
    };
    const ratio = (a: Colour, b: Colour) => {
      const [low, high] = [luminance(a), luminance(b)].sort((p, q) => p - q);
      return (high! + 0.05) / (low! + 0.05);
    };
    const behind = (element: Element, picture: Colour): Colour => {
      const layers: Colour[] = [];
      for (let at: Element | null = element; at; at = at.parentElement) {
        if (at.tagName === 'MAIN') break; // the picture
        const colour = parse(getComputedStyle(at).backgroundColor);
        layers.push(colour);
        if (colour[3] === 1) break;
        if (getComputedStyle(at).position === 'fixed' && at.closest('.panel, dialog') === null) break;
      }
      return layers.reverse().reduce((below, top) => over(top, below), picture);
    };
    const out: string[] = [];
    const visit = (element: Element, text: string) => {
      const style = getComputedStyle(element);
      if (element.closest(':disabled') || !(element as HTMLElement).checkVisibility()) return;
      if (element.closest('canvas, option, noscript, .offscreen')) return;
      const size = parseFloat(style.fontSize);
      const needed = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700) ? 3 : 4.5;
      const worst = Math.min(
        ...([0, 255] as const).map((v) => {
          const back = behind(element, [v, v, v, 1]);
          return ratio(over(parse(style.color), back), back);
        }),
      );
      if (worst < needed) out.push(`${text.trim().slice(0, 40)} (${element.className}): ${worst.toFixed(2)}`);
    };
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = texts.nextNode(); node; node = texts.nextNode())
      if (node.textContent?.trim() && node.parentElement) visit(node.parentElement, node.textContent);
    for (const field of document.querySelectorAll<HTMLInputElement>('input.number, select')) visit(field, field.value);
    return out;
  });
}

it.each(['dark', 'light'] as const)('can be read in %s colours', async (scheme) => {
  const page = await pages.open('about:blank', 1200, 800);
  await page.emulateMedia({ colorScheme: scheme });
  await page.goto(server.url);
  await converged(page);
  await page.waitForFunction((theme) => document.documentElement.dataset['theme'] === theme, scheme);
  await page.evaluate(() => {
    const { frame, edit, meter, view } = window.viewer!;
    edit.selectNext(1);
    void view.setMode('irradiance');
    meter.toggle();
    frame.toasts.show('A note', 'good');
    frame.toasts.show('A refusal', 'bad');
    frame.setBanner('link', 'No connection.', 'Try now', () => undefined);
    frame.setWelcome('empty');
    frame.legend.show('Irradiance', 'lx', 1, 1000);
  });
  for (const tab of TABS) {
    await page.getByRole('tab', { name: tab }).click();
    expect(await unreadable(page), tab).toEqual([]);
  }
  await page.evaluate(() => window.viewer!.frame.help.showModal());
  expect(await unreadable(page), 'keys').toEqual([]);
  // What the test sees by: letters in the colour of what is behind them are found.
  await page.evaluate(() => (document.querySelector<HTMLElement>('.chip .state')!.style.color = 'var(--card)'));
  expect((await unreadable(page)).length).toBe(1);
});

it('reaches every control with Tab, and shows where one is', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  await page.evaluate(() => window.viewer!.edit.selectNext(1));
  await until(() => page.locator('.toast').count(), (notes) => notes === 0); // prettier-ignore
  for (const tab of TABS) {
    await page.getByRole('tab', { name: tab }).focus();
    await page.keyboard.press('Enter');
    // Who is to be reached: tabs that are not open are reached with the arrows from the one that is.
    const all = await page.evaluate(() => {
      const list = [...document.querySelectorAll<HTMLElement>('canvas.view, button, input, select, a, summary, pre')]; // prettier-ignore
      const wanted = list.filter(
        (element) =>
          element.checkVisibility() && !element.matches(':disabled, .offscreen, [role=tab][aria-selected=false]'),
      );
      wanted.forEach((element, i) => (element.dataset['stop'] = String(i)));
      (document.activeElement as HTMLElement).blur();
      return wanted.length;
    });
    expect(all).toBeGreaterThan(12);
    const reached = new Set<string>();
    const unseen: string[] = [];
    for (let i = 0; i < 2 * all && reached.size < all; ++i) {
      await page.keyboard.press('Tab');
      const { stop, seen, name } = await page.evaluate(() => {
        const at = document.activeElement as HTMLElement;
        const { outlineStyle, outlineWidth } = getComputedStyle(at);
        const seen = at === document.body || (outlineStyle !== 'none' && parseFloat(outlineWidth) >= 2);
        return { stop: at.dataset['stop'], seen, name: at.getAttribute('aria-label') ?? at.textContent ?? '' };
      });
      if (stop) reached.add(stop);
      if (!seen) unseen.push(name);
    }
    expect(unseen, tab).toEqual([]);
    expect(reached.size, tab).toBe(all);
    await page.evaluate(() => document.querySelectorAll('[data-stop]').forEach((e) => e.removeAttribute('data-stop')));
  }
});

it('moves between tabs with the arrows', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await page.getByRole('tab', { name: 'View' }).focus();
  for (const tab of ['Solve', 'Scene', 'Measure', 'Share', 'View']) {
    await page.keyboard.press('ArrowRight');
    expect(await page.evaluate(() => document.activeElement?.textContent)).toBe(tab);
    expect(await page.getByRole('tab', { name: tab }).getAttribute('aria-selected')).toBe('true');
  }
});

it('does by keys alone what a designer does: choose, move, look at, undo', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  await page.keyboard.press('Tab'); // the picture
  expect(await page.evaluate(() => document.activeElement?.tagName)).toBe('CANVAS');
  const name = () =>
    page.evaluate(() => {
      const { edit } = window.viewer!;
      return edit.selection && edit.document.gltf.nodes![edit.selection.node]!.name;
    });
  await until(
    async () => {
      await page.keyboard.press('n');
      return name();
    },
    (chosen) => chosen === 'tall_block',
  );
  const cut = (fields: (HTMLElement | SVGElement)[]) =>
    fields.filter((field) => field.scrollWidth > field.clientWidth).map((field) => (field as HTMLInputElement).value);
  expect(await page.locator('.vector input').evaluateAll(cut)).toEqual([]);
  const field = page.getByLabel('Position, m, y');
  const before = await field.inputValue();
  const was = (await sceneOf(server)).nodes.find((node) => node.name === 'tall_block')!.translation;
  while (!(await field.evaluate((element) => element === document.activeElement))) await page.keyboard.press('Tab');
  await page.keyboard.press('Control+a');
  await page.keyboard.type('0.05');
  await page.keyboard.press('Enter');
  const place = () =>
    page.evaluate(() => {
      const { edit } = window.viewer!;
      return edit.document.gltf.nodes![edit.selection!.node]!.translation!;
    });
  const height = async () => (await place())[1];
  expect(await until(height, (y) => y === 0.05)).toBe(0.05);
  expect(await place()).toEqual([was[0], 0.05, was[2]]); // to the last digit, though fewer are shown
  // A key that takes an object away does not do so from another control.
  const look = page.getByRole('button', { name: 'Frame object' });
  await look.focus();
  const eye = () => page.evaluate(() => window.viewer!.viewer.rig.target.toArray());
  const from = await eye();
  await page.keyboard.press('Enter');
  expect(await eye()).not.toEqual(from);
  await page.keyboard.press('Backspace');
  expect(await name()).toBe('tall_block');
  await page.locator('canvas.view').focus();
  await page.keyboard.press('Control+z');
  expect(await until(height, (y) => y !== 0.05)).toBe(Number(before));
  // The list of keys opens, is read from its top, and closes.
  await page.keyboard.press('?');
  expect(await page.locator('dialog.help').evaluate((dialog) => dialog.scrollTop)).toBe(0);
  await page.keyboard.press('Escape');
  expect(await page.locator('dialog.help').isVisible()).toBe(false);
});

it('reads the light by touch, and shows what was tapped in the list', async () => {
  const page = await pages.open(server.url, 360, 640, { touch: true });
  await converged(page);
  await page.getByRole('button', { name: 'Light meter' }).tap();
  await page.evaluate(() => {
    const { canvas } = window.viewer!.viewer;
    canvas.addEventListener('pointerleave', () => (canvas.dataset['left'] = 'yes'));
  });
  await page.touchscreen.tap(180, 250);
  await page.locator('canvas.view[data-left]').waitFor(); // a finger that is lifted leaves the picture
  await turns(page, 2); // what else would follow has followed
  await page.locator('.meter').getByText(/ ± .* lx/).waitFor(); // prettier-ignore
  await page.getByRole('button', { name: 'Light meter' }).tap();
  // The last of the list, chosen while the list is not to be seen.
  await page.evaluate(() => window.viewer!.edit.selectNext(-1));
  await page.getByRole('button', { name: 'Panel', exact: true }).tap();
  await page.getByRole('tab', { name: 'Scene' }).tap();
  const seen = () =>
    page.evaluate(() => {
      const list = document.querySelector('.tree')!.getBoundingClientRect();
      const at = document.querySelector('.tree [aria-current]')!.getBoundingClientRect();
      return at.top >= list.top && at.bottom <= list.bottom;
    });
  expect(await until(seen, (is) => is)).toBe(true);
});

it('leaves the picture free of the legend where the panel leaves little of it', async () => {
  const page = await pages.open(server.url, 360, 640);
  await converged(page);
  const picture = () => page.locator('canvas.view').boundingBox();
  await page.evaluate(() => window.viewer!.frame.togglePanel());
  const whole = (await picture())!;
  for (const mode of ['radiosity', 'mips'] as const) {
    await page.evaluate((mode) => window.viewer!.view.setMode(mode), mode);
    const legend = page.locator('.legend');
    await legend.waitFor();
    const [around, free] = [(await legend.boundingBox())!, (await picture())!];
    expect(around.y, mode).toBeGreaterThanOrEqual(free.y + free.height);
    expect(free.height, mode).toBeGreaterThan(whole.height - 40);
    const cut = () => page.evaluate(() => [...document.querySelectorAll('.legend, .legend *')].filter((e) => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1).map((e) => e.className)); // prettier-ignore
    expect(await cut(), mode).toEqual([]);
  }
});

it.each([360, 1000])(
  'shows notes beside the legend on a page of %i pixels, with and without the panel',
  async (width) => {
    const page = await pages.open(server.url, width, 640);
    await converged(page);
    await page.evaluate(() => window.viewer!.view.setMode('radiosity'));
    await page.locator('.legend').waitFor();
    await page.evaluate(() =>
      window.viewer!.frame.toasts.show('A note that is long enough to be as wide as it may be', 'bad'),
    );
    for (let i = 0; i < 2; ++i) {
      await page.evaluate(() => window.viewer!.frame.togglePanel());
      const [note, legend] = [
        (await page.locator('.toast').boundingBox())!,
        (await page.locator('.legend').boundingBox())!,
      ];
      expect(note.y + note.height, `${i}`).toBeLessThanOrEqual(legend.y);
    }
  },
);

it('pans and zooms the pages by keys', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  await page.evaluate(() => window.viewer!.view.setMode('pages'));
  const flat = () =>
    page.evaluate(() => {
      const { position, zoom } = window.viewer!.viewer.pagesView.camera;
      return { x: position.x, y: position.y, zoom };
    });
  const before = await flat();
  await page.locator('canvas.view').focus();
  for (const key of ['ArrowRight', 'ArrowUp', '+']) await page.keyboard.press(key);
  const after = await flat();
  expect(after.x).toBeGreaterThan(before.x);
  expect(after.y).toBeGreaterThan(before.y);
  expect(after.zoom).toBeGreaterThan(before.zoom);
  await drawn(page);
  expect(await flat()).toEqual(after);
  await page.keyboard.press('f');
  expect(await flat()).toEqual(before);
});

it('takes a bracket that is written with AltGr', async () => {
  const page = await pages.open(server.url, 900, 600);
  await converged(page);
  const stops = () => page.evaluate(() => window.viewer!.viewer.exposure.stops);
  const press = (modifierAltGraph: boolean) =>
    page.evaluate((modifierAltGraph) => {
      const init = { key: ']', code: 'Digit9', ctrlKey: true, altKey: true, modifierAltGraph, bubbles: true };
      document.querySelector('canvas.view')!.dispatchEvent(new KeyboardEvent('keydown', init));
    }, modifierAltGraph);
  await press(true);
  expect(await stops()).toBe(0.25);
  await press(false); // is a command of the browser or of the system
  expect(await stops()).toBe(0.25);
});

it('reads where the pointer is, nothing where that has left the picture, and its middle by keys', async () => {
  const page = await pages.open(server.url, 1200, 800);
  await converged(page);
  const [card, mark] = [page.locator('.meter'), page.locator('.meter-mark')];
  await page.mouse.move(400, 260);
  await page.keyboard.press('m');
  await card.waitFor();
  expect(await mark.isVisible()).toBe(false); // the pointer shows what is read
  await page.mouse.move(1100, 400);
  await drawn(page); // light that comes is no reason to read anywhere else
  expect(await card.isVisible()).toBe(false);
  await page.locator('canvas.view').focus();
  await page.keyboard.press('ArrowRight');
  await card.waitFor();
  const [box, around] = [(await page.locator('canvas.view').boundingBox())!, (await mark.boundingBox())!];
  expect(Math.abs(around.x + around.width / 2 - box.x - box.width / 2)).toBeLessThan(1.5);
  expect(Math.abs(around.y + around.height / 2 - box.y - box.height / 2)).toBeLessThan(1.5);
  await page.keyboard.press('m');
  expect([await card.isVisible(), await mark.isVisible()]).toEqual([false, false]);
});

it.each([
  [360, 640],
  [1200, 800],
])('keeps clear of the notch and the bar of a screen of %i x %i', async (width, height) => {
  const page = await pages.open(server.url, width, height);
  await converged(page);
  await page.evaluate(() => window.viewer!.view.setMode('radiosity')); // which has a legend
  const session = await page.context().newCDPSession(page);
  const beside = width > height ? 47 : 0; // a notch is at the short side
  const insets = { top: 47 - beside, left: beside, bottom: 34, right: beside };
  await session.send('Emulation.setSafeAreaInsetsOverride' as never, { insets } as never);
  await page.evaluate(() => {
    const { frame } = window.viewer!;
    frame.toasts.show('A note');
    frame.setBanner('link', 'No connection.');
  });
  const outside = (selectors: string) =>
    page.evaluate(
      ({ selectors, insets }) =>
        [...document.querySelectorAll<HTMLElement>(selectors)]
          .filter((element) => element.checkVisibility())
          .filter((element) => {
            const { top, left, bottom, right } = element.getBoundingClientRect();
            const isBelow = bottom > innerHeight - insets.bottom;
            return top < insets.top || left < insets.left || right > innerWidth - insets.right || isBelow;
          })
          .map(({ className }) => className),
      { selectors, insets },
    );
  const floating = '.bar > *, .tools, .legend, .toast, .banner, .tabs button';
  for (const open of [false, true]) {
    if ((await page.evaluate(() => window.viewer!.frame.panelOpen)) !== open)
      await page.evaluate(() => window.viewer!.frame.togglePanel());
    expect(await outside(floating), open ? 'with the panel' : 'without the panel').toEqual([]);
  }
  // What stands last in the panel can be scrolled to where it is seen.
  await page.evaluate(() => window.viewer!.frame.showTab('Share'));
  await page.evaluate(() => document.querySelector('#tab-Share')!.scrollTo(0, 1e6));
  expect(await outside('#tab-Share section:last-child dd:last-child')).toEqual([]);
});
