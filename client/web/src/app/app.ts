// The viewer as a whole: what comes from the server goes to the picture and the panels, and what the user does goes to
// the server. One for a page.

import { EditSession } from '../editing/edit_session';
import { GeometrySession } from '../scenes/geometry_fetch';
import { InputSession } from './input';
import { PeopleSession } from '../looking/people_session';
import { SceneSession } from '../scenes/scene_session';
import { hasScene, StateSession } from '../session/solve_state';
import { ViewSession } from '../looking/view_session';
import type { SentEdit } from '../document/scene_document';
import { Connection, type LinkState } from '../protocol/connection';
import {
  type Bookmark,
  type HelloReply,
  type LightmapsNote,
  type Notifications,
  type Progress,
  type Resume,
  type ScenePatchReply,
  type ServerInfo,
  type Settings,
  type SolveHistory,
  type Status,
  type SubscribeParams,
} from '../protocol/messages';
import { PageName } from '../protocol/page_name';
import { ConnectionLost } from '../protocol/rpc';
import { TileFeed } from '../tiles/tile_feed';
import { Frame } from '../ui/frame';
import { SharePanel } from '../ui/share_panel';
import { SolvePanel } from '../ui/solve_panel';
import { store, stored } from '../page/stored';
import { Share } from '../scenes/share';
import { MOST_MIPS } from '../view/light/lightmap_page';
import { Viewer } from '../view/viewer';

/** Below this the network is slow: fewer versions of the light are asked for. Bytes a second. */
const SLOW_RATE = 400_000;
const SLOW_HZ = 2;

export class App {
  readonly connection: Connection;
  readonly frame: Frame;
  readonly viewer: Viewer;
  readonly view: ViewSession;
  readonly edit: EditSession;
  readonly share: Share;
  readonly people: PeopleSession;
  readonly solve: SolvePanel;
  readonly scene = new SceneSession(this);
  readonly state = new StateSession(this);
  /** What the server has told of its solve over this connection. */
  progress: Progress | undefined;
  /** Up to where all light has come over this connection, and was decoded. */
  bookmark: Bookmark | undefined;
  /** For tests and for the console: what happened when, milliseconds since the page began. */
  readonly marks: Record<string, number> = {};
  private readonly tiles: TileFeed;
  private readonly geometry = new GeometrySession(this);
  /** Up to where the light that is here is known to be all there was, to go on from. */
  resume: Resume | undefined;
  private readonly name = new PageName(stored('name') ?? '');
  private token = addressedToken() ?? stored('token', 'session');
  private slow = false;
  private everOpen = false;
  private isRenaming = false;
  private epoch = '';
  private awaited: (() => void)[] = [];
  /** Over a new connection it is asked first whether edits that wait are still meant. */
  private sceneKnown = Promise.resolve();

  constructor() {
    const { name } = this;
    // First of all: while the server answers, the page builds itself. Nothing comes in before this is done.
    this.connection = new Connection(
      {
        url: `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`,
        get client() {
          return name.client;
        },
        token: () => this.token,
        resume: () => this.resume,
        subscription: () => this.subscription(),
      },
      {
        state: (state, detail) => this.onLink(state, detail),
        ready: (info, hello) => void this.onReady(info, hello),
        notification: (method, params) => this.onNotification(method, params),
        tile: (frame) => {
          if (!('firstTile' in this.marks)) this.mark('firstTile');
          this.tiles.push(frame);
          this.adaptToNetwork(); // the last tiles come when the solve has nothing to tell any more
        },
      },
    );
    this.connection.open();
    this.solve = new SolvePanel({
      pauseOrResume: () => this.pauseOrResume(),
      restart: () => void this.ask('solve.restart'),
      configure: (settings) => void this.configure(settings),
      notAccepted: (text, wanted) => this.notAccepted(text, wanted),
    });
    this.view = new ViewSession(this);
    this.edit = new EditSession(this, name, (...edit) => this.sendEdit(...edit));
    this.people = new PeopleSession(this);
    const sharePanel = new SharePanel({
      name: { person: name.person, unnamed: name.unnamed },
      setName: (person) => this.rename(person),
      sharing: this.people.sharing,
      setSharing: (on) => this.people.setSharing(on),
      copyLink: () => void this.share.copyLink(),
      copyEdit: (form) => void this.share.copyEdit(form),
      download: (what) => void this.share.download(what),
    });
    this.frame = new Frame(
      {
        toggleWalk: () => this.view.toggleWalk(),
        frameAll: () => this.view.frameAll(),
        gizmo: (mode) => this.edit.setGizmo(mode),
        toggleMeter: () => this.view.meter.toggle(),
        addLamp: () => void this.edit.addLamp(),
        undo: () => void this.edit.history.undo(),
        redo: () => void this.edit.history.redo(),
      },
      {
        View: this.view.panel.element,
        Solve: this.solve.element,
        Scene: this.edit.panel.element,
        Share: sharePanel.element,
      },
    );
    this.viewer = this.makeViewer();
    this.viewer.showPeople(this.people.people);
    this.frame.overPicture(this.people.people.labels);
    this.share = new Share(this, sharePanel);
    this.tiles = new TileFeed({
      set: (kind) => this.viewer.layouts.setOf(kind),
      dropped: (bytes, reason) => {
        this.connection.used(bytes);
        if (reason) console.warn(`a tile was dropped: ${reason}`);
      },
      queued: () => this.viewer.invalidate(),
    });
    this.view.start();
    new InputSession(this).start();
    this.edit.start();
    this.scene.takeDrops();
    document.addEventListener('visibilitychange', () => this.onVisible());
    window.addEventListener('online', () => this.connection.open());
    window.addEventListener('hashchange', () => {
      const token = addressedToken();
      if (token) this.giveToken(token);
    });
  }

  /** Without WebGL 2 it throws, and nothing goes on: whoever opened the page is told by main.ts. */
  private makeViewer(): Viewer {
    try {
      return new Viewer(this.frame.canvas, {
        used: (bytes) => this.connection.used(bytes),
        drawn: () => {
          this.view.onDrawn();
          this.people.tellSoon();
          this.state.again(); // the last tiles may be in the picture now
        },
        sceneShown: (scene) => {
          this.view.onSceneShown(scene);
          this.edit.onSceneShown();
          this.frame.sceneShown = true;
          this.state.again(); // no message covers the picture
        },
        gizmoDragging: (active) => this.edit.onGizmoDragging(active),
        gizmoChanged: (object, mode) => this.edit.onGizmoChanged(object, mode),
        contextLost: (lost) => {
          const text = lost ? 'The browser has lost the graphics card; waiting for it to return.' : undefined;
          this.frame.setBanner('card', text);
        },
      });
    } catch (error) {
      this.connection.close();
      throw error;
    }
  }

  mark(name: string): void {
    this.marks[name] ??= performance.now();
  }

  /** Of a field in which something else was expected. */
  notAccepted(text: string, wanted: string): void {
    this.frame.toasts.show(`“${text}” is not accepted: enter ${wanted}`, 'bad');
  }

  /** A call whose refusal is shown. */
  async ask<T>(method: string, params: object = {}): Promise<T | undefined> {
    try {
      return await this.connection.call<T>(method, params);
    } catch (error) {
      this.frame.toasts.show((error as Error).message, 'bad');
      return undefined;
    }
  }

  /** HTTP with the token, where there is one. Rejects with what the server says is wrong. */
  async fetch(path: string, init: RequestInit = {}): Promise<Response> {
    const headers = new Headers(init.headers);
    if (this.token) headers.set('Authorization', `Bearer ${this.token}`);
    const response = await fetch(path, { ...init, headers, cache: 'no-store' });
    if (response.ok) return response;
    const body = (await response.json().catch(() => undefined)) as
      | { error?: { message: string; where?: string } }
      | undefined;
    const { message, where } = body?.error ?? { message: `HTTP ${response.status}` };
    throw new Error(where ? `${where}: ${message}` : message);
  }

  /** Streams the quantity that the view needs. */
  async resubscribe(): Promise<void> {
    if (this.connection.isOpen) await this.connection.subscribe().catch(() => undefined);
  }

  private subscription(): SubscribeParams {
    const base = this.viewer.set?.baseMip ?? 0;
    return {
      minMip: base,
      maxMip: Math.min(16, base + MOST_MIPS - 1),
      quantity: this.viewer.dataSet?.quantity ?? 'irradiance',
      maxHz: document.hidden ? 0.5 : this.slow ? SLOW_HZ : 0,
    };
  }

  private onLink(state: LinkState, detail: string): void {
    this.bookmark = undefined;
    this.scene.document.forget();
    this.edit?.history.forget(); // the first time there is no page yet
    if (state === 'open') {
      this.state.forgetTrouble();
      this.progress = undefined; // that of a server which has started again is not that of its scene
      this.frame.setBanner('link', undefined);
      if (this.everOpen && !this.isRenaming) this.frame.toasts.show('Reconnected', 'good');
      this.everOpen = true;
      this.isRenaming = false;
    } else if (state === 'waiting') {
      this.frame.setState('Not connected', 'bad');
      this.frame.setBanner('link', `No connection: ${detail}.`, 'Try now', () => this.connection.open());
    } else if (state === 'refused') {
      this.frame.setState('Not connected', 'bad');
      this.frame.askToken(detail, (token) => this.giveToken(token));
    } else if (!this.everOpen) {
      this.frame?.setState('Connecting', 'busy');
    }
  }

  /** A session keeps its name: there is a new one, which goes on where this one is. */
  private rename(person: string): void {
    this.name.person = person;
    store('name', this.name.person);
    this.isRenaming = this.connection.isOpen;
    this.connection.renew();
  }

  /** Whether something was done by this page. */
  isMine(by: string): boolean {
    return this.name.isMine(by);
  }

  private giveToken(token: string): void {
    this.token = token;
    store('token', token, 'session');
    this.connection.open();
  }

  private async onReady(info: ServerInfo, hello: HelloReply): Promise<void> {
    this.mark('ready');
    if (this.epoch !== '' && this.epoch !== hello.epoch) {
      this.resume = undefined;
      this.scene.onServerAnew();
    } else if (this.epoch !== '' && !hello.resumed) {
      this.sceneKnown = this.scene.onUnresumed();
    }
    this.epoch = hello.epoch;
    this.view.meter.forget();
    if (!hello.resumed) this.viewer.layouts.forget();
    for (const resolve of this.awaited.splice(0)) resolve();
    this.view.onCapabilities();
    this.share.onServer(info);
    this.people.onReady();
    this.edit.history.askSoon();
    const isOwed = hello.revision > 0 && (!hello.resumed || this.scene.document.isOwed);
    if (isOwed) void this.sceneKnown.then(() => this.connection.info === info && this.scene.document.want());
    await this.fetchStatus();
    void this.fetchHistory(info);
    const { count } = await this.connection.call<{ count: number }>('viewers').catch(() => ({ count: 1 }));
    this.onViewers(count);
  }

  private onViewers(count: number): void {
    this.frame.setViewers(count);
    this.people.onViewers(count);
  }

  private onStatus(status: Status): void {
    this.onSettings(status.settings);
    this.solve.setWarnings(status.warnings, status.warningCount);
    this.onProgress(status);
  }

  private onSettings(settings: Settings): void {
    this.solve.setSettings(settings);
    this.viewer.setSky(settings.sky ?? undefined);
  }

  private onNotification<K extends keyof Notifications>(method: K, params: Notifications[K]): void {
    const handlers: { [M in keyof Notifications]?: (note: Notifications[M]) => void } = {
      progress: (note) => this.onProgress(note),
      'scene.patched': (note) => {
        this.edit.onPatched(note, () => this.scene.document.want(note.revision));
        this.edit.history.askSoon();
      },
      'scene.loaded': (note) => this.scene.onLoaded(note.revision),
      lightmaps: (note) => void this.onLightmaps(note),
      bookmark: (note) => this.onBookmark(note),
      viewers: (note) => this.onViewers(note.count),
      cameras: (note) => this.people.onCameras(note.cameras),
      draining: () => this.frame.toasts.show('The server is stopping'),
      notice: (note) => this.frame.toasts.show(note.text),
      'solve.configured': (settings) => this.onSettings(settings),
    };
    handlers[method]?.(params);
  }

  private onProgress(progress: Progress): void {
    this.progress = progress;
    this.solve.update(progress);
    if (!hasScene(progress)) this.scene.forget();
    this.state.show(progress);
  }

  /** On a slow line intermediate versions are left out; moving about needs no network at all. */
  private adaptToNetwork(): void {
    const { rate } = this.connection.credit;
    const slow = rate > 0 && rate < (this.slow ? 1.5 : 1) * SLOW_RATE;
    if (slow === this.slow) return;
    this.slow = slow;
    void this.resubscribe();
    if (slow) this.frame.toasts.show('Slow network: light is updated less often');
  }

  async fetchStatus(): Promise<void> {
    const status = await this.connection.call<Status>('status').catch(() => undefined);
    if (status) this.onStatus(status);
  }

  /** After the status, by which the plot knows whether what it has is of this solve. */
  private async fetchHistory(info: ServerInfo): Promise<void> {
    if (!this.connection.has('solve.history')) return;
    const history = await this.connection.call<SolveHistory>('solve.history').catch(() => undefined);
    if (history && info === this.connection.info) this.solve.setHistory(history.samples);
  }

  private async onLightmaps(note: LightmapsNote): Promise<void> {
    const set = this.viewer.layouts.expect(note);
    if (!set) return;
    this.state.settleLight();
    if (this.view.renewData() || set.baseMip > 0) await this.resubscribe();
    await this.geometry.load(note, set);
  }

  private onBookmark(bookmark: Bookmark): void {
    const { info } = this.connection;
    const set = this.viewer.layouts.setOf(bookmark.quantity);
    // Tiles on their way through the decoder belong to this bookmark, too.
    this.tiles.afterAll(() => {
      // Another is looked at by now, or pages have another layout: nothing was said of that one.
      if (!set || set !== this.viewer.layouts.setOf(bookmark.quantity) || info !== this.connection.info) return;
      set.close();
      this.bookmark = bookmark;
      const { quantity, revision, tileVersion } = bookmark;
      if (quantity === 'irradiance') this.resume = { epoch: this.epoch, revision, tileVersion };
      this.state.again();
    });
  }

  private onVisible(): void {
    if (!document.hidden) {
      this.connection.open();
      void this.connection.check();
      this.viewer.invalidate();
    }
    void this.resubscribe();
  }

  private pauseOrResume(): void {
    void this.ask(this.progress?.state === 'paused' ? 'solve.resume' : 'solve.pause');
  }

  togglePause(): void {
    if (this.progress?.state === 'paused' || this.progress?.state === 'solving') this.pauseOrResume();
  }

  private async configure(settings: Partial<Settings>): Promise<void> {
    const all = await this.ask<Settings>('solve.configure', settings);
    if (all) this.onSettings(all);
    else this.solve.showSettings();
  }

  /** A lost answer is asked for again with the same id, which the server does once. */
  private async sendEdit(edit: SentEdit, isMeant: () => boolean): Promise<ScenePatchReply> {
    for (;;) {
      if (!this.connection.isOpen) await new Promise<void>((resolve) => this.awaited.push(resolve));
      await this.sceneKnown;
      if (!isMeant()) throw new Error('its scene is gone');
      try {
        return await this.connection.call<ScenePatchReply>('scene.patch', edit);
      } catch (error) {
        if (!(error instanceof ConnectionLost) && this.connection.isOpen) throw error;
      }
    }
  }
}

/** From the link (#token=...), where it does not stay to be seen. */
function addressedToken(): string | undefined {
  const hash = new URLSearchParams(location.hash.slice(1));
  const token = hash.get('token') ?? undefined;
  if (token) {
    store('token', token, 'session');
    hash.delete('token');
    history.replaceState(null, '', `#${hash}`);
  }
  return token;
}
