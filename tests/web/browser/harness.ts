// Starts a real radiosityd and a real browser, and sees to it that neither is left behind.

import { spawn, type ChildProcess } from 'node:child_process';
import { accessSync, constants } from 'node:fs';
import { chromium, type Browser, type BrowserContext, type Page } from 'playwright-core';

function program(variable: string, otherwise?: string): string {
  const path = process.env[variable] ?? otherwise;
  if (!path) throw new Error(`${variable} must name a program (ctest sets it)`);
  accessSync(path, constants.X_OK); // a program that is missing is a failure, not a skip
  return path;
}

export const SCENES = process.env['RADIOSITY_SCENES'] ?? '';

export class Server {
  private process: ChildProcess | undefined;
  url = '';

  constructor(
    private readonly scene: string | undefined,
    private readonly options: string[] = [],
  ) {}

  /** Again on the same port after stop(). */
  async start(): Promise<void> {
    const listen = this.url ? new URL(this.url).host : '127.0.0.1:0';
    const args = [...(this.scene ? [this.scene] : []), '--listen', listen, '--log-level', 'error', ...this.options];
    const child = spawn(program('RADIOSITYD'), args, {
      stdio: ['ignore', 'pipe', 'inherit'],
    });
    this.process = child;
    let text = '';
    this.url = await new Promise<string>((resolve, reject) => {
      child.once('exit', (code) => reject(new Error(`radiosityd ended with ${code}: ${text}`)));
      child.stdout.on('data', (data: Buffer) => {
        text += data.toString();
        const found = /listening on (http:\/\/\S+)/.exec(text);
        if (found) resolve(found[1]!);
      });
    });
  }

  async stop(signal: NodeJS.Signals = 'SIGKILL'): Promise<void> {
    const child = this.process;
    this.process = undefined;
    if (!child || child.exitCode !== null) return;
    const ended = new Promise((resolve) => child.once('exit', resolve));
    child.kill(signal);
    await ended;
  }
}

export class Pages {
  /** Errors and warnings of all pages: there shall be none. */
  readonly complaints: string[] = [];
  private browser: Browser | undefined;
  private contexts: BrowserContext[] = [];

  /** Without `card` Chromium renders in software, so that tests need no graphics card. */
  async launch(card = false): Promise<void> {
    const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
    this.browser = await chromium.launch({
      executablePath: program('CHROMIUM', '/usr/bin/chromium'),
      // Containers have no room for Chromium's sandbox.
      args: ['--no-sandbox', '--ignore-gpu-blocklist', ...(card ? [] : software)],
    });
  }

  get started(): Browser {
    if (!this.browser) throw new Error('launch() comes first');
    return this.browser;
  }

  /** What draws WebGL, in Chromium's words. */
  async renderer(): Promise<string> {
    const page = await this.open('about:blank');
    const name = await page.evaluate(() => {
      const gl = document.createElement('canvas').getContext('webgl2');
      const extension = gl?.getExtension('WEBGL_debug_renderer_info');
      return gl && extension ? String(gl.getParameter(extension.UNMASKED_RENDERER_WEBGL)) : 'no WebGL 2';
    });
    await this.closeAll();
    return name;
  }

  async open(url: string, width = 480, height = 480, options: { touch?: boolean } = {}): Promise<Page> {
    const context = await this.browser!.newContext({
      viewport: { width, height },
      hasTouch: options.touch ?? false,
    });
    this.contexts.push(context);
    const page = await context.newPage();
    page.on('console', (message) => {
      if (['error', 'warning'].includes(message.type()) && !isNoise(message.text()))
        this.complaints.push(`${message.type()}: ${message.text()}`);
    });
    page.on('pageerror', (error) => this.complaints.push(`exception: ${error.message}`));
    await page.goto(url);
    return page;
  }

  /** The pages of a test. */
  async closeAll(): Promise<void> {
    for (const context of this.contexts.splice(0)) await context.close();
  }

  async quit(): Promise<void> {
    await this.browser?.close();
  }
}

/** For all tests of a file: one server that shows the scene, and pages that complain of nothing. */
export function serveAll(scene: string): { server: Server; pages: Pages } {
  const server = new Server(`${SCENES}/${scene}`);
  const pages = new Pages();
  beforeAll(async () => {
    await server.start();
    await pages.launch();
  });
  afterEach(async () => {
    await pages.closeAll();
    expect(pages.complaints.splice(0)).toEqual([]);
  });
  afterAll(async () => {
    await pages.quit();
    await server.stop('SIGTERM');
  });
  return { server, pages };
}

/** What Chromium says of its own software renderer, and of networks that are gone, which no page can keep it from. */
function isNoise(text: string): boolean {
  return /GPU stall due to ReadPixels|WebSocket connection to|ERR_CONNECTION_REFUSED|CONTEXT_LOST_WEBGL/.test(text);
}

/** Until the solve has stopped at its target, and all light is on the screen. */
export async function converged(page: Page): Promise<void> {
  const done = page.waitForFunction(
    () => {
      const app = window.viewer;
      const set = app?.viewer.shown?.set;
      return app?.progress?.state === 'converged' && set?.complete && set.waiting === 0 && app.viewer.set === set;
    },
    undefined,
    { timeout: 60_000 },
  );
  await done.catch(async (error: Error) => {
    const state = await page.evaluate(() => {
      const app = window.viewer;
      const set = app?.viewer.shown?.set;
      return JSON.stringify({
        open: app?.connection.isOpen,
        progress: app?.progress,
        complete: set?.complete,
        waiting: set?.waiting,
        isShown: set !== undefined && app?.viewer.set === set,
      });
    });
    throw new Error(`${error.message}; the page stands at ${state}`);
  });
}

/** What a page shows, or the picture at a URL, brought to `side` x `side` pixels: R, G, B of each, 0 to 255. */
export async function pixels(page: Page, side: number, url?: string): Promise<number[]> {
  return page.evaluate(
    async ({ side, url }) => {
      const blob = url ? await (await fetch(url)).blob() : await window.viewer!.viewer.picture();
      const image = await createImageBitmap(blob, {
        resizeWidth: side,
        resizeHeight: side,
        resizeQuality: 'high',
      });
      const context = new OffscreenCanvas(side, side).getContext('2d', {
        alpha: false,
      })!; // upon black, as the server's

      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, side, side);
      return Array.from(data).filter((_, i) => i % 4 !== 3);
    },
    { side, url },
  );
}

/** Mean and 99th percentile of the channels' differences, of 255. */
export function difference(a: readonly number[], b: readonly number[]): { mean: number; p99: number } {
  const all = a.map((v, i) => Math.abs(v - b[i]!)).sort((x, y) => x - y);
  return {
    mean: all.reduce((sum, v) => sum + v, 0) / all.length,
    p99: all[Math.floor(0.99 * all.length)]!,
  };
}

export async function sceneOf(server: Server): Promise<{
  nodes: { name: string; translation: number[] }[];
  materials: { name: string; [member: string]: unknown }[];
  scenes: { nodes: number[] }[];
}> {
  return (await (await fetch(`${server.url}/scene.gltf`)).json()) as never;
}

export async function until<T>(what: () => Promise<T>, good: (value: T) => boolean, ms = 20_000): Promise<T> {
  const end = Date.now() + ms;
  for (;;) {
    const value = await what();
    if (good(value) || Date.now() > end) return value;
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}
