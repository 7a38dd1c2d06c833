// What the pointer and the keys do on the picture.

import type { EditHistory } from '../editing/edit_history';
import type { EditSession } from '../editing/edit_session';
import type { LightMeter } from '../looking/light_meter';
import type { ViewSession } from '../looking/view_session';
import type { Frame } from '../ui/frame';
import { listenToKeys } from '../ui/keys';
import { VIEW_MODES } from '../view/looks/view_modes';
import type { Viewer } from '../view/viewer';

/** A click moves less than this, in pixels; what moves farther is a drag. */
const CLICK_SLACK = 5;
/** Stops by which a key changes the exposure. */
const EXPOSURE_STEP = 0.25;

export interface InputTargets {
  frame: Pick<Frame, 'canvas' | 'help' | 'toDevice' | 'togglePanel' | 'toggleChrome'>;
  picture: Pick<Viewer, 'rig' | 'pagesView' | 'gizmo' | 'exposure' | 'pickAt'>;
  view: Pick<
    ViewSession,
    'mode' | 'setMode' | 'toggleWalk' | 'frameAll' | 'frameNode' | 'nextCamera' | 'toggleFalseColour' | 'setStops'
  >;
  meter: Pick<LightMeter, 'isOn' | 'pointTo' | 'leave' | 'aimByKeys' | 'toggle'>;
  edit: Pick<
    EditSession,
    'selection' | 'select' | 'selectHit' | 'selectNext' | 'setGizmo' | 'addLamp' | 'removeSelected' | 'cancelDrag'
  >;
  history: Pick<EditHistory, 'undo' | 'redo'>;
  togglePause(): void;
}

export class Input {
  private readonly actions: Record<string, () => unknown>;

  constructor(private readonly to: InputTargets) {
    this.actions = this.makeActions();
  }

  /** When the page is built. */
  start(): void {
    const { frame, picture, view } = this.to;
    const { rig, pagesView } = picture;
    this.listenToPointer(frame.canvas);
    listenToKeys(frame.canvas, {
      camera: (event, down) => this.aimed(rig.key(event, down)),
      turn: (right, up) => this.aimed(view.mode.flat ? pagesView.pan(right, up) : rig.turn(right, up)),
      zoom: (factor) => this.aimed(view.mode.flat ? pagesView.zoom(factor) : rig.zoom(factor)),
      press: (key, event) => this.press(key, event),
    });
  }

  private listenToPointer(canvas: HTMLCanvasElement): void {
    const { picture, meter } = this.to;
    let down: { x: number; y: number } | undefined;
    canvas.addEventListener('pointerdown', (event) => {
      canvas.focus({ preventScroll: true });
      // A finger tells its place only when it touches, so the gizmo may learn only now that it is meant.
      down = picture.gizmo.busy ? undefined : { x: event.clientX, y: event.clientY };
    });
    canvas.addEventListener('pointerup', (event) => {
      const moved = down && Math.hypot(event.clientX - down.x, event.clientY - down.y);
      down = undefined;
      if (moved !== undefined && moved <= CLICK_SLACK && event.button === 0) this.click(event);
    });
    canvas.addEventListener('pointermove', (event) => meter.pointTo(event));
    canvas.addEventListener('pointerleave', ({ pointerType }) => {
      if (pointerType !== 'touch') meter.leave(); // a lifted finger has left, too, but still means its last place
    });
  }

  private click(event: PointerEvent): void {
    const { frame, picture, meter, edit } = this.to;
    if (meter.isOn) return meter.pointTo(event);
    edit.selectHit(picture.pickAt(...frame.toDevice(event.clientX, event.clientY))?.object);
  }

  /** Keys that turn the picture also aim the meter. `result`: of the key; false: it did nothing. */
  private aimed<T>(result: T): T {
    if (result !== false) this.to.meter.aimByKeys();
    return result;
  }

  private press(key: string, event: KeyboardEvent): boolean {
    const { view, edit, history } = this.to;
    // Some systems report AltGr, with which some keyboards write [ and ], as Control and Alt.
    const isWritten = event.getModifierState('AltGraph');
    const command = !isWritten && (event.ctrlKey || event.metaKey);
    if (command && key.toLowerCase() === 'z') return done(event.shiftKey ? history.redo() : history.undo());
    if (command && key.toLowerCase() === 'y') return done(history.redo());
    if (command || (event.altKey && !isWritten)) return false;
    if (key === 'Delete' || key === 'Backspace') return isAmongObjects(event.target) && done(edit.removeSelected());
    if (/^\d$/.test(key)) return done(view.setMode(VIEW_MODES[(Number(key) + 9) % 10]?.id ?? 'lit'));
    const action = this.actions[key];
    return action ? done(action()) : false;
  }

  private makeActions(): Record<string, () => unknown> {
    const { frame, picture, view, meter, edit, togglePause } = this.to;
    return {
      v: () => view.toggleWalk(),
      f: () => view.frameAll(),
      F: () => view.frameNode(edit.selection?.node),
      c: () => view.nextCamera(),
      x: () => view.toggleFalseColour(),
      '[': () => view.setStops(picture.exposure.stops - EXPOSURE_STEP),
      ']': () => view.setStops(picture.exposure.stops + EXPOSURE_STEP),
      m: () => this.aimed(meter.toggle()),
      n: () => edit.selectNext(1),
      N: () => edit.selectNext(-1),
      t: () => edit.setGizmo('translate'),
      r: () => edit.setGizmo('rotate'),
      y: () => edit.setGizmo('scale'),
      l: () => edit.addLamp(),
      ' ': togglePause,
      p: () => frame.togglePanel(),
      h: () => frame.toggleChrome(),
      Escape: () => edit.cancelDrag() || edit.select(undefined),
      '?': () => frame.help.showModal(),
    };
  }
}

function done(_result: unknown): true {
  return true;
}

/**
 * Delete and Backspace act in the picture and in the list of objects; elsewhere the user meant the control in focus.
 */
function isAmongObjects(target: EventTarget | null): boolean {
  return target === document.body || (target instanceof Element && target.closest('canvas.view, .tree') !== null);
}
