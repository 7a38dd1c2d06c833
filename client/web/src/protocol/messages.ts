// The messages of protocol/README.md that the viewer uses, as types. Names and units are the specification's.

export type Json = null | boolean | number | string | Json[] | { [member: string]: Json };

export interface PatchOperation {
  op: 'add' | 'remove' | 'replace' | 'move' | 'copy' | 'test';
  path: string;
  from?: string;
  value?: Json;
}
export type Patch = PatchOperation[];

export interface ServerInfo {
  server: string;
  epoch: string;
  revision: number;
  capabilities: string[];
  limits: Record<string, number>;
  lightmaps: number;
  glRenderer: string;
  authRequired: boolean;
}

export interface Resume {
  epoch: string;
  revision: number;
  tileVersion: number;
}

export interface HelloReply {
  epoch: string;
  revision: number;
  tileFormat: string;
  codec: string;
  creditBytes: number;
  resumed: boolean;
}

export type SolveState = 'empty' | 'loading' | 'solving' | 'paused' | 'converged' | 'timeLimit' | 'limited' | 'failed';

export interface Progress {
  revision: number;
  state: SolveState;
  tileVersion: number;
  shots: number;
  shotsPerSecond: number;
  seconds: number;
  secondsLeft?: number;
  error: {
    /** What people see: RMS at the surface. */
    total: number;
    /** RMS of texels alone; the next three are its parts. */
    texels: number;
    residual: number;
    sampling: number;
    variation?: number;
    discretization: number;
    /** What 95 % of places are off by less than, once that is measured; until then `total` is an estimate. */
    p95?: number;
    /** It is on its way. */
    measuring?: boolean;
  };
  energy: Record<string, number>;
  patches: number;
  nodes: number;
  surfaces: number;
  polygons: number;
  failure?: string;
  /** Why no light arrives anywhere, so that the error means nothing. */
  unlit?: string;
  /** How much of a load is done, in [0, 1]; while the state is `loading`. */
  fraction?: number;
}

/** The errors of `progress` at one moment of the solve. */
export interface ErrorSample {
  seconds: number;
  total: number;
  texels: number;
  residual: number;
  sampling: number;
  variation: number;
}

/** How the error of the present solve has fallen; oldest first. */
export interface SolveHistory {
  revision: number;
  samples: ErrorSample[];
}

/** Radiance of everything outside the scene above and below the horizon, nits. */
export interface Sky {
  upper: [number, number, number];
  lower: [number, number, number];
}

/** How a scene is solved: lamps shoot and texels gather; progressive shooting; Lum, Ma and Max 2002. */
export type Method = 'gather' | 'shooting' | 'paper';

export interface Settings {
  targetError: number;
  timeLimitMs: number | null;
  texels: number;
  texelSize: number;
  seed: number;
  doubleSided: boolean;
  /** `texels` are the most there may be. */
  adaptive: boolean;
  method: Method;
  /** For scenes without a sky of their own. */
  sky?: Sky | null;
}

export interface Status extends Progress {
  settings: Settings;
  warnings: string[];
  warningCount: number;
  counters: Record<string, number>;
  glRenderer: string;
}

export interface PageSize {
  width: number;
  height: number;
  mips: number;
}

export interface LightmapsNote {
  layout: number;
  revision: number;
  pages: PageSize[];
  uvs: string;
}

export interface ScenePatchedNote {
  revision: number;
  patch: Patch;
  by: string;
}

export interface Bookmark {
  revision: number;
  tileVersion: number;
  quantity: string;
}

/** Where a viewer looks from: eye and the point looked at, metres. */
export interface SharedCamera {
  viewer: number;
  name: string;
  position: [number, number, number];
  target: [number, number, number];
}

/** The light of one texel at one version, and its standard error; linear R, G, B, lux. */
export interface TexelReply {
  revision: number;
  tileVersion: number;
  irradiance: [number, number, number];
  error: [number, number, number];
}

export interface SubscribeParams {
  lightmaps?: number[];
  minMip?: number;
  maxMip?: number;
  maxHz?: number;
  quantity?: string;
}

export interface ScenePatchReply {
  revision: number;
  affected: { surfaces: number; shots: number };
}

/** Notifications by method. The viewer ignores all others, as the specification demands. */
export interface Notifications {
  serverInfo: ServerInfo;
  progress: Progress;
  'scene.patched': ScenePatchedNote;
  'scene.loaded': { revision: number };
  lightmaps: LightmapsNote;
  bookmark: Bookmark;
  viewers: { count: number };
  cameras: { cameras: SharedCamera[] };
  draining: { graceMs: number };
  notice: { kind: string; text: string };
  'solve.configured': Settings;
}

/** One of the revisions since the scene was loaded. */
export interface PastRevision {
  revision: number;
  kind: 'load' | 'patch' | 'undo' | 'redo';
  /** The scene's name, if the revision is a load. */
  summary?: string;
  by?: string;
  /** The patch is taken back at present. */
  undone?: boolean;
}

export interface SceneHistory {
  revision: number;
  undoable: number;
  redoable: number;
  /** Oldest first. */
  revisions: PastRevision[];
}

/** HTTP status: the layout of the file is no longer the newest. */
export const NO_CONTENT = 204;

export const SUBPROTOCOL = 'radiosity.v1';

/** A close code after which it is useless to try again. */
export const CLOSE_UNAUTHENTICATED = 1008;
export const CLOSE_OVERLOAD = 1013;
/** JSON-RPC error of a missing or wrong token. */
export const UNAUTHENTICATED = -32001;
/** JSON-RPC error: there is no object of that name, or no scene. */
export const NOT_FOUND = -32004;
export const STALE_REVISION = -32009;

/** Lux, or percent for daylight factors. */
export interface PlaneFigures {
  mean: number;
  meanError: number;
  minimum: number;
  minimumError: number;
  maximum: number;
  maximumError: number;
  median: number;
  uniformity: number;
  uniformityError: number;
  solveError: number;
}

export type PlaneVerdict = 'passes' | 'fails' | 'undecided';

/** A measuring plane, as `solve.measure` and /planes.json tell it; by point, row by row. */
export interface MeasuredPlane extends PlaneFigures {
  node: number;
  name: string;
  columns: number;
  rows: number;
  lux?: number[];
  standardError?: number[];
  target?: { lux?: number; uniformity?: number };
  verdict?: { lux?: PlaneVerdict; uniformity?: PlaneVerdict; all: PlaneVerdict };
  daylightFactor?: PlaneFigures & { percent?: number[]; standardError?: number[] };
}

export interface Planes {
  revision: number;
  state: string;
  error: number;
  planes: MeasuredPlane[];
}
