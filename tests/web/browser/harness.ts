// Starts a real radiosityd and a real browser, and sees to it that neither is left behind.

import { spawn, type ChildProcess } from 'node:child_process';
import { accessSync, constants } from 'node:fs';
import { connect, createServer, type AddressInfo, type Socket } from 'node:net';
import { chromium, type Browser, type BrowserContext, type Page } from 'playwright-core';

function program(variable: string, otherwise?: string): string {
  const path = process.env[variable] ?? otherwise;
  if (!path) throw new Error(`${variable} must name a program (ctest sets it)`);
  accessSync(path, constants.X_OK); // a program that is missing is a failure, not a skip
  return path;
}

export const SCENES = process.env['RADIOSITY_SCENES'] ?? '';

/**
 * How long a test waits for what must come. Solves, other tests and Chromium's software renderer share two cores, and
 * nothing here is a statement about speed: only what never comes ends a wait. Less than a test may take, which then says
 * what it waited for.
 */
const PATIENCE_MS = 200_000;

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
    const args = [
      ...(this.scene ? [this.scene] : []),
      '--listen',
      listen,
      '--uniform',
      '--log-level',
      'error',
      ...this.options,
    ];
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

/** A line between pages and a server that carries so many bytes a second to them, all connections together. */
export class SlowLine {
  private readonly sockets = new Set<Socket>();
  private free = 0; // when what was sent has gone through
  private readonly server = createServer((page) => this.join(page));

  constructor(
    private readonly target: string,
    private readonly bytesPerSecond: number,
  ) {}

  /** The URL of its far end. */
  async start(): Promise<string> {
    await new Promise<void>((resolve) => this.server.listen(0, '127.0.0.1', resolve));
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  stop(): void {
    this.server.close();
    for (const socket of this.sockets) socket.destroy();
  }

  private join(page: Socket): void {
    const { hostname, port } = new URL(this.target);
    const server = connect(Number(port), hostname);
    for (const socket of [page, server]) {
      this.sockets.add(socket);
      socket.on('error', () => undefined);
      socket.on('close', () => {
        page.destroy();
        server.destroy();
      });
    }
    page.pipe(server);
    server.on('data', (bytes: Buffer) => {
      server.pause();
      this.free = Math.max(this.free, performance.now()) + (1000 * bytes.length) / this.bytesPerSecond;
      setTimeout(() => {
        page.write(bytes);
        server.resume();
      }, this.free - performance.now());
    });
  }
}

export class Pages {
  /** Errors and warnings of all pages: there shall be none. */
  readonly complaints: string[] = [];
  private browser: Browser | undefined;
  private contexts: BrowserContext[] = [];

  /** `size`: of pages that are opened without one, pixels. */
  constructor(private readonly size: readonly [width: number, height: number] = [480, 480]) {}

  /** Without `card`, Chromium's arguments for one, it renders in software, so that tests need no graphics card. */
  async launch(card?: readonly string[]): Promise<void> {
    const software = ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
    this.browser = await chromium.launch({
      executablePath: program('CHROMIUM', '/usr/bin/chromium'),
      // Containers have no room for Chromium's sandbox. A renderer in software that gets no processor does not hang.
      args: ['--no-sandbox', '--ignore-gpu-blocklist', '--disable-gpu-watchdog', ...(card ?? software)],
      timeout: PATIENCE_MS,
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

  async open(
    url: string,
    width = this.size[0],
    height = this.size[1],
    options: { touch?: boolean } = {},
  ): Promise<Page> {
    const context = await this.browser!.newContext({
      viewport: { width, height },
      hasTouch: options.touch ?? false,
    });
    this.contexts.push(context);
    context.setDefaultTimeout(PATIENCE_MS);
    await context.addInitScript(keepNotes);
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

/** For each test of a file: servers of its own, which end with it, and pages that complain of nothing. */
export function serveEach(): { serve: (scene?: string, ...options: string[]) => Promise<Server>; pages: Pages } {
  const pages = new Pages();
  const servers: Server[] = [];
  beforeAll(() => pages.launch());
  afterEach(async () => {
    await pages.closeAll();
    for (const server of servers.splice(0)) await server.stop();
    expect(pages.complaints.splice(0)).toEqual([]);
  });
  afterAll(() => pages.quit());
  const serve = async (scene?: string, ...options: string[]) => {
    const server = new Server(scene, options);
    await server.start();
    servers.push(server);
    return server;
  };
  return { serve, pages };
}

/** What Chromium says of its own software renderer, and of networks that are gone, which no page can keep it from. */
function isNoise(text: string): boolean {
  return /GPU stall due to ReadPixels|WebSocket connection to|ERR_CONNECTION_REFUSED|CONTEXT_LOST_WEBGL/.test(text);
}

declare global {
  interface Window {
    /** All notes that the page has shown. */
    notes?: string[];
  }
}

/** In the page: notes go by themselves, some before a test that gets no processor has looked. */
function keepNotes(): void {
  const notes: string[] = [];
  window.notes = notes;
  new MutationObserver((changes) => {
    for (const node of changes.flatMap(({ addedNodes }) => [...addedNodes]))
      if (node instanceof HTMLElement && node.matches('.toast')) notes.push(node.firstChild?.textContent ?? '');
  }).observe(document, { childList: true, subtree: true });
}

/** Until a note of the page says so, or has said so. */
export async function said(page: Page, what: RegExp): Promise<void> {
  const notes = () => page.evaluate(() => window.notes!);
  await until(notes, (all) => all.some((text) => what.test(text)));
}

/**
 * Until the solve has stopped at its target, all of its light is on the screen, and the page's document is the server's.
 * `documentWaits`: the test holds the document back.
 */
export async function converged(page: Page, documentWaits = false): Promise<void> {
  const state = () =>
    page.evaluate(async () => {
      const app = window.viewer;
      const set = app?.viewer.shown?.set;
      const here = {
        open: app?.connection.isOpen,
        state: app?.progress?.state,
        tileVersion: app?.bookmark?.quantity === 'irradiance' ? app.bookmark.tileVersion : -1,
        revision: app?.edit.document.revision,
        waiting: set?.waiting,
        shown: set?.complete === true && app?.viewer.set === set && app.viewer.dataSet === undefined,
        banner: document.querySelector<HTMLElement>('.banner:not([hidden])')?.innerText,
        contextLost: app?.viewer.renderer.getContext().isContextLost(),
        sinceFrameMs: app && performance.now() - (app.viewer as unknown as { lastFrame: number }).lastFrame,
      };
      if (!app || !here.open || here.state !== 'converged' || !here.shown || here.waiting !== 0) return { here };
      // What the page was told last may be of a solve that is over: the server is asked.
      const there = await app.connection
        .call<{ state: string; tileVersion: number; revision: number }>('status')
        .then(({ state, tileVersion, revision }) => ({ state, tileVersion, revision }))
        .catch(() => undefined);
      return { here, there };
    });
  await until(
    state,
    ({ here, there }) =>
      there?.state === 'converged' &&
      here.tileVersion >= there.tileVersion &&
      (documentWaits || here.revision === there.revision),
  );
}

/** Until the server has answered all that was done by hand: a drag, say, is told in parts. */
export async function answered(page: Page): Promise<void> {
  const pending = () =>
    page.evaluate(() => (window.viewer!.edit.document as unknown as { pending: unknown[] }).pending.length);
  await until(pending, (count) => count === 0);
}

/** Until a frame was drawn that shows what there is now. */
export async function drawn(page: Page): Promise<void> {
  await page.evaluate(
    () =>
      new Promise<void>((resolve) => {
        const { view, viewer } = window.viewer!;
        const others = view.onDrawn;
        view.onDrawn = () => {
          view.onDrawn = others;
          view.onDrawn();
          resolve();
        };
        viewer.invalidate();
      }),
  );
}

/** Until so many turns of the page have come and gone, in which something that moves goes on. */
export async function turns(page: Page, count: number): Promise<void> {
  await page.evaluate(async (count) => {
    for (let i = 0; i < count; ++i) await new Promise((resolve) => requestAnimationFrame(resolve));
  }, count);
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

/** Until it is good; what never is fails, with what it was last. */
export async function until<T>(what: () => Promise<T>, good: (value: T) => boolean): Promise<T> {
  const end = Date.now() + PATIENCE_MS;
  for (;;) {
    const value = await what();
    if (good(value)) return value;
    if (Date.now() > end)
      throw new Error(`never came, but stayed ${JSON.stringify(value)}; wanted: ${good.toString()}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

export interface GltfNode {
  name?: string;
  mesh?: number;
  translation?: number[];
  rotation?: number[];
  scale?: number[];
  children?: number[];
}

const PAPER = {
  name: 'paper',
  emissiveFactor: [1, 1, 1],
  pbrMetallicRoughness: { baseColorFactor: [0.5, 0.5, 0.5, 1] },
};

/** A glTF of squares, one metre wide, that face upwards: mesh i of `nodes` is one of the i-th material. */
export function squares(nodes: GltfNode[], materials: object[] = [PAPER], meshName = 'square'): string {
  const corners = [-0.5, 0, -0.5, -0.5, 0, 0.5, 0.5, 0, 0.5, 0.5, 0, -0.5];
  const bytes = Buffer.alloc(60);
  corners.forEach((v, i) => bytes.writeFloatLE(v, 4 * i));
  [0, 1, 2, 0, 2, 3].forEach((v, i) => bytes.writeUInt16LE(v, 48 + 2 * i));
  const hung = new Set(nodes.flatMap(({ children }) => children ?? []));
  const uses = JSON.stringify(materials).includes('KHR_materials_emissive_strength');
  return JSON.stringify({
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: nodes.map((_, i) => i).filter((i) => !hung.has(i)) }],
    nodes,
    meshes: materials.map((_, material) => ({
      name: meshName,
      primitives: [{ attributes: { POSITION: 0 }, indices: 1, material }],
    })),
    ...(uses ? { extensionsUsed: ['KHR_materials_emissive_strength'] } : {}),
    materials,
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: 'VEC3', min: [-0.5, 0, -0.5], max: [0.5, 0, 0.5] },
      { bufferView: 1, componentType: 5123, count: 6, type: 'SCALAR' },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 12 },
    ],
    buffers: [{ byteLength: 60, uri: `data:application/octet-stream;base64,${bytes.toString('base64')}` }],
  });
}

/** Loads a glTF as another program of Ann's would. */
export async function putScene(server: Server, gltf: string): Promise<void> {
  const answer = await fetch(`${server.url}/scene?name=squares.gltf&client=Ann`, {
    method: 'PUT',
    body: gltf,
    headers: { 'Content-Type': 'model/gltf+json' },
  });
  if (!answer.ok) throw new Error(await answer.text());
}
