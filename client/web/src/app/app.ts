// Builds the viewer out of its parts and passes messages between them: from the server to the picture and the panels,
// and from the user to the server. The parts know each other only through what each of them asks for. One for a page.

import { EditHistory } from '../editing/edit_history';
import { EditSession } from '../editing/edit_session';
import { LightMeter } from '../looking/light_meter';
import { PeopleSession } from '../looking/people_session';
import { PlanesSession } from '../looking/planes_session';
import { ViewSession, type Placed } from '../looking/view_session';
import type { Connection, LinkState } from '../protocol/connection';
import type { Bookmark, HelloReply, LightmapsNote, Notifications, Progress, ServerInfo } from '../protocol/messages';
import { GeometryFetch } from '../scenes/geometry_fetch';
import { SceneSession } from '../scenes/scene_session';
import { SkyFetch } from '../scenes/sky_fetch';
import { WebFetch } from '../scenes/web_fetch';
import { Share } from '../scenes/share';
import { Bookmarks } from '../session/bookmarks';
import { LinkNotice } from '../session/link_notice';
import type { Streamed } from '../session/light_stream';
import { Session } from '../session/session';
import { SolveSession } from '../session/solve_session';
import { hasScene, SolveState } from '../session/solve_state';
import { TileFeed } from '../tiles/tile_feed';
import { takeDrops } from '../ui/drop_files';
import { Frame } from '../ui/frame';
import { Toasts } from '../ui/toast';
import { MOST_MIPS } from '../view/light/lightmap_page';
import { Viewer } from '../view/viewer';
import { Input } from './input';

/** The coarsest mip of the protocol. */
const COARSEST_MIP = 16;

type Handlers = { [M in keyof Notifications]?: (note: Notifications[M]) => void };

export class App {
  /** For tests and for the console: when something happened for the first time, milliseconds since the page began. */
  readonly marks: Record<string, number> = {};
  readonly session: Session;
  readonly frame: Frame;
  readonly viewer: Viewer;
  readonly solve: SolveSession;
  readonly view: ViewSession;
  readonly meter: LightMeter;
  private readonly sky: SkyFetch;
  readonly edit: EditSession;
  readonly people: PeopleSession;
  readonly planes: PlanesSession;
  readonly scene: SceneSession<Placed>;
  readonly geometry: GeometryFetch;
  readonly share: Share;
  readonly tiles: TileFeed;
  readonly bookmarks: Bookmarks;
  private readonly link: LinkNotice;
  private readonly history: EditHistory;
  private readonly state: SolveState;
  private readonly handlers = this.makeHandlers();

  /** Throws where the browser has no WebGL 2. */
  constructor() {
    const toasts = new Toasts();
    this.session = new Session(() => this.streamed(), toasts);
    this.frame = this.makeFrame(toasts);
    this.viewer = this.makeViewer();
    const { connection, access } = this.session;
    this.link = new LinkNotice(connection, access, this.frame);
    this.geometry = new GeometryFetch(access.fetch, this.viewer, toasts);
    this.solve = this.makeSolve();
    this.view = this.makeView();
    this.sky = new SkyFetch({ fetch: access.fetch, show: (bytes) => this.viewer.setSkyPicture(bytes) });
    this.edit = this.makeEdit();
    this.planes = this.makePlanes();
    this.history = this.makeHistory();
    this.meter = this.makeMeter();
    this.people = new PeopleSession(connection, this.viewer.rig, () => this.viewer.invalidate());
    this.scene = this.makeScene();
    this.share = this.makeShare();
    this.state = this.makeState();
    this.tiles = this.makeTiles();
    this.bookmarks = this.makeBookmarks();
    this.start();
  }

  // ---- for tests and for the console ----

  get connection(): Connection {
    return this.session.connection;
  }

  get progress(): Progress | undefined {
    return this.session.told.progress;
  }

  get bookmark(): Bookmark | undefined {
    return this.session.told.bookmark;
  }

  // ---- parts ----

  private makeFrame(toasts: Toasts): Frame {
    return new Frame(toasts, {
      toggleWalk: () => this.view.toggleWalk(),
      frameAll: () => this.view.frameAll(),
      gizmo: (mode) => this.edit.setGizmo(mode),
      toggleMeter: () => this.meter.toggle(),
      addLamp: () => void this.edit.addLamp(),
      undo: () => void this.history.undo(),
      redo: () => void this.history.redo(),
    });
  }

  private makeViewer(): Viewer {
    try {
      return new Viewer(this.frame.canvas, {
        used: (bytes) => this.connection.used(bytes),
        drawn: () => {
          this.view.onDrawn();
          this.meter.onDrawn();
          this.people.tellSoon();
          this.state.again(); // the last tiles may be in the picture now
        },
        sceneShown: (scene) => {
          this.view.onSceneShown(scene);
          this.edit.onSceneShown();
          this.frame.sceneShown = true;
          this.state.again(); // the welcome must not cover the picture
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

  private makeSolve(): SolveSession {
    const { connection, told } = this.session;
    return new SolveSession(connection, (method, params) => this.session.ask(method, params), told, {
      settings: (settings) => this.viewer.setSky(settings.sky ?? undefined),
      progress: (progress) => {
        if (!hasScene(progress)) {
          this.scene.forget(progress.revision);
          this.frame.sceneShown = false;
        }
        this.state.show(progress);
      },
      notAccepted: (text, wanted) => this.notAccepted(text, wanted),
    });
  }

  private makeView(): ViewSession {
    return new ViewSession({
      picture: this.viewer,
      server: this.connection,
      frame: this.frame,
      resubscribe: () => this.session.stream.renew(),
      mark: (name) => this.mark(name),
      notAccepted: (text, wanted) => this.notAccepted(text, wanted),
    });
  }

  private makeEdit(): EditSession {
    const { fetch } = this.session.access;
    const webs = new WebFetch({ fetch, changed: (known) => this.edit.showWebs(known) });
    return new EditSession({
      name: this.session.access.name,
      picture: this.viewer,
      frame: this.frame,
      send: this.session.sender.send,
      historyChanged: () => {
        this.history.show();
        const { lastEdit } = this.edit.document;
        if (lastEdit) this.share.onEdit(lastEdit);
      },
      frameSelection: () => this.view.frameNode(this.edit.selection?.node),
      loadFile: (file) => void this.scene.loadFile(file),
      upload: (file) => this.scene.send(file),
      documentChanged: (gltf, isWhole) => {
        this.sky.onDocument(gltf, isWhole);
        if (isWhole) webs.forget();
        this.planes.refresh();
      },
      notAccepted: (text, wanted) => this.notAccepted(text, wanted),
      webWanted: (gltf, light) => void webs.want(gltf, light),
    });
  }

  private makePlanes(): PlanesSession {
    return new PlanesSession({
      fetch: this.session.access.fetch,
      document: this.edit.document,
      picture: this.viewer,
      notes: this.frame.toasts,
      add: () => void this.edit.addPlane(),
      select: (node) => this.edit.select({ node, material: undefined }),
      edit: (label, patch) => this.edit.make(label, patch),
      notAccepted: (text, wanted) => this.notAccepted(text, wanted),
    });
  }

  private makeHistory(): EditHistory {
    return new EditHistory({
      document: this.edit.document,
      server: this.connection,
      ask: (method) => this.session.ask(method),
      show: (undo, redo) => this.frame.setHistory(undo, redo),
      notes: this.frame.toasts,
    });
  }

  private makeMeter(): LightMeter {
    return new LightMeter({
      server: this.connection,
      told: this.session.told,
      picture: this.viewer,
      frame: this.frame,
      mode: () => this.view.mode,
      gltf: () => this.edit.document.gltf,
    });
  }

  private makeScene(): SceneSession<Placed> {
    const { access, told, connection } = this.session;
    return new SceneSession({
      server: connection,
      fetch: access.fetch,
      notes: this.frame.toasts,
      document: this.edit.document,
      told,
      camera: this.view,
      picture: this.viewer,
      isMine: (by) => access.name.isMine(by),
      deselect: () => this.edit.select(undefined),
      loaded: () => {
        this.history.askSoon();
        void this.solve.fetchStatus();
      },
    });
  }

  private makeShare(): Share {
    const { access } = this.session;
    const { person, unnamed } = access.name;
    return new Share(
      {
        fetch: access.fetch,
        layout: () => this.viewer.set?.note,
        picture: () => this.viewer.picture(),
        linkHash: () => this.view.linkHash(),
        notes: this.frame.toasts,
      },
      {
        name: { person, unnamed },
        setName: (name) => this.link.rename(name),
        sharing: this.people.sharing,
        setSharing: (on) => this.people.setSharing(on),
      },
    );
  }

  private makeState(): SolveState {
    return new SolveState(this.session.told, this.viewer, this.frame, () => this.view.mode, {
      restart: () => this.solve.restart(),
      addLamp: () => void this.edit.addLamp(),
      showIrradiance: () => void this.view.setMode('irradiance'),
    });
  }

  private makeTiles(): TileFeed {
    return new TileFeed({
      set: (kind) => this.viewer.layouts.setOf(kind),
      dropped: (bytes, reason) => {
        this.connection.used(bytes);
        if (reason) console.warn(`a tile was dropped: ${reason}`);
      },
      queued: () => this.viewer.invalidate(),
    });
  }

  private makeBookmarks(): Bookmarks {
    return new Bookmarks(this.session.told, {
      info: () => this.connection.info,
      setOf: (quantity) => this.viewer.layouts.setOf(quantity),
      afterTiles: (act) => this.tiles.afterAll(act),
      taken: () => this.state.again(),
    });
  }

  private start(): void {
    this.session.listen({
      state: (state, detail) => this.onLink(state, detail),
      ready: (info, hello) => void this.onReady(info, hello),
      notification: (method, params) => this.handlers[method]?.(params),
      tile: (frame) => this.onTile(frame),
    });
    this.viewer.showPeople(this.people.people);
    this.frame.overPicture(this.people.people.labels);
    this.frame.setPanels({
      View: this.view.panel.element,
      Solve: this.solve.panel.element,
      Scene: this.edit.panel.element,
      Measure: this.planes.panel.element,
      Share: this.share.panel.element,
    });
    this.view.start();
    new Input({
      frame: this.frame,
      picture: this.viewer,
      view: this.view,
      meter: this.meter,
      edit: this.edit,
      history: this.history,
      togglePause: () => this.solve.togglePause(),
    }).start();
    this.edit.start();
    this.link.start();
    takeDrops((file) => void this.scene.loadFile(file));
    document.addEventListener('visibilitychange', () => this.onVisible());
  }

  // ---- messages ----

  private makeHandlers(): Handlers {
    return {
      progress: (note) => this.solve.onProgress(note),
      'scene.patched': (note) => {
        this.edit.onPatched(note, () => this.scene.document.want(note.revision));
        this.history.askSoon();
      },
      'scene.loaded': (note) => this.scene.onLoaded(note.revision),
      lightmaps: (note) => void this.onLightmaps(note),
      bookmark: (note) => this.bookmarks.take(note),
      viewers: (note) => this.onViewers(note.count),
      cameras: (note) => this.people.onCameras(note.cameras),
      draining: () => this.frame.toasts.show('The server is stopping'),
      notice: (note) => this.frame.toasts.show(note.text),
      'solve.configured': (settings) => this.solve.onSettings(settings),
    };
  }

  private onLink(state: LinkState, detail: string): void {
    const { told } = this.session;
    told.bookmark = undefined;
    this.scene.document.forget();
    this.history.forget();
    if (state === 'open') {
      this.state.forgetTrouble();
      told.progress = undefined; // a server that has restarted may have another scene
    }
    this.link.show(state, detail);
  }

  private async onReady(info: ServerInfo, hello: HelloReply): Promise<void> {
    this.mark('ready');
    const { told, sender } = this.session;
    if (told.epoch !== '' && told.epoch !== hello.epoch) {
      told.resume = undefined;
      this.scene.onServerAnew();
    } else if (told.epoch !== '' && !hello.resumed) {
      sender.sceneKnown = this.scene.onUnresumed();
    }
    told.epoch = hello.epoch;
    this.meter.forget();
    if (!hello.resumed) this.viewer.layouts.forget();
    sender.opened();
    this.view.onCapabilities();
    this.share.onServer(info);
    this.people.onReady();
    this.history.askSoon();
    const isOwed = hello.revision > 0 && (!hello.resumed || this.scene.document.isOwed);
    if (isOwed) void sender.sceneKnown.then(() => this.connection.info === info && this.scene.document.want());
    await this.solve.fetchStatus();
    void this.solve.fetchHistory(info);
    const { count } = await this.connection.call<{ count: number }>('viewers').catch(() => ({ count: 1 }));
    this.onViewers(count);
  }

  private onTile(frame: ArrayBuffer): void {
    this.mark('firstTile');
    this.tiles.push(frame);
    this.session.stream.adapt(); // here, as the last tiles come when the server has no more messages about the solve
  }

  private async onLightmaps(note: LightmapsNote): Promise<void> {
    const set = this.viewer.layouts.expect(note);
    if (!set) return;
    this.state.settleLight();
    if (this.view.renewData() || set.baseMip > 0) await this.session.stream.renew();
    await this.geometry.load(note, set);
  }

  private onViewers(count: number): void {
    this.frame.setViewers(count);
    this.people.onViewers(count);
  }

  private onVisible(): void {
    if (!document.hidden) {
      this.connection.open();
      void this.connection.check();
      this.viewer.invalidate();
    }
    void this.session.stream.renew();
  }

  private streamed(): Streamed {
    const minMip = this.viewer.set?.baseMip ?? 0;
    return {
      minMip,
      maxMip: Math.min(COARSEST_MIP, minMip + MOST_MIPS - 1),
      quantity: this.viewer.dataSet?.quantity ?? 'irradiance',
    };
  }

  private mark(name: string): void {
    this.marks[name] ??= performance.now();
  }

  private notAccepted(text: string, wanted: string): void {
    this.frame.toasts.show(`“${text}” is not accepted: enter ${wanted}`, 'bad');
  }
}
