// What the pointer and the keys do on the picture. Part of the App.

import type { App } from './app';
import { listenToKeys } from '../ui/keys';
import { VIEW_MODES } from '../view/looks/view_modes';

/** A click that moves less is no drag, pixels. */
const CLICK_SLACK = 5;

export class InputSession {
  constructor(private readonly app: App) {}

  /** When the page is there. */
  start(): void {
    const { canvas } = this.app.frame;
    const { rig, pagesView } = this.app.viewer;
    const { view } = this.app;
    this.listenToPointer(canvas);
    listenToKeys(canvas, {
      camera: (event, down) => this.aimed(rig.key(event, down)),
      turn: (right, up) => this.aimed(view.mode.flat ? pagesView.pan(right, up) : rig.turn(right, up)),
      zoom: (factor) => this.aimed(view.mode.flat ? pagesView.zoom(factor) : rig.zoom(factor)),
      press: (key, event) => this.press(key, event),
    });
  }

  private listenToPointer(canvas: HTMLCanvasElement): void {
    let down: { x: number; y: number } | undefined;
    canvas.addEventListener('pointerdown', (event) => {
      canvas.focus({ preventScroll: true });
      // Touch tells of its place only when it comes down, so the gizmo may not know yet that it is meant.
      down = this.app.viewer.gizmo.busy ? undefined : { x: event.clientX, y: event.clientY };
    });
    canvas.addEventListener('pointerup', (event) => {
      const moved = down && Math.hypot(event.clientX - down.x, event.clientY - down.y);
      down = undefined;
      if (moved !== undefined && moved <= CLICK_SLACK && event.button === 0) this.click(event);
    });
    canvas.addEventListener('pointermove', (event) => {
      this.app.view.meter.pointTo(event);
    });
    canvas.addEventListener('pointerleave', ({ pointerType }) => {
      if (pointerType === 'touch') return; // a finger that is lifted has left: what it pointed at is still meant
      this.app.view.meter.leave();
    });
  }

  private click(event: PointerEvent): void {
    if (this.app.view.meter.isOn) return this.app.view.meter.pointTo(event);
    const hit = this.app.viewer.pickAt(...this.app.frame.toDevice(event.clientX, event.clientY));
    this.app.edit.selectHit(hit?.object);
  }

  /** By keys, which aim the meter; `result` of what they did. */
  private aimed<T>(result: T): T {
    if (result !== false) this.app.view.meter.aimByKeys();
    return result;
  }

  private press(key: string, event: KeyboardEvent): boolean {
    const { app } = this;
    // Where [ and ] are written with AltGr, some systems tell of that as of Control and Alt.
    const isWritten = event.getModifierState('AltGraph');
    const command = !isWritten && (event.ctrlKey || event.metaKey);
    if (command && key.toLowerCase() === 'z')
      return done(event.shiftKey ? app.edit.history.redo() : app.edit.history.undo());
    if (command && key.toLowerCase() === 'y') return done(app.edit.history.redo());
    if (command || (event.altKey && !isWritten)) return false;
    if (key === 'Delete' || key === 'Backspace') return isAmongObjects(event.target) && done(app.edit.removeSelected());
    if (/^\d$/.test(key)) return done(app.view.setMode(VIEW_MODES[(Number(key) + 9) % 10]?.id ?? 'lit'));
    const actions: Record<string, () => unknown> = {
      v: () => app.view.toggleWalk(),
      f: () => app.view.frameAll(),
      F: () => app.view.frameSelection(),
      c: () => app.view.nextCamera(),
      x: () => app.view.toggleFalseColour(),
      '[': () => app.view.setStops(app.viewer.exposure.stops - 0.25),
      ']': () => app.view.setStops(app.viewer.exposure.stops + 0.25),
      m: () => this.aimed(this.app.view.meter.toggle()),
      n: () => app.edit.selectNext(1),
      N: () => app.edit.selectNext(-1),
      t: () => app.edit.setGizmo('translate'),
      r: () => app.edit.setGizmo('rotate'),
      y: () => app.edit.setGizmo('scale'),
      l: () => app.edit.addLamp(),
      ' ': () => app.togglePause(),
      p: () => app.frame.togglePanel(),
      h: () => app.frame.toggleChrome(),
      Escape: () => app.edit.cancelDrag() || app.edit.select(undefined),
      '?': () => app.frame.help.showModal(),
    };
    const action = actions[key];
    return action ? done(action()) : false;
  }
}

function done(_result: unknown): true {
  return true;
}

/** Keys that take something away do so in the picture and in the list of objects: elsewhere they were meant for a control. */
function isAmongObjects(target: EventTarget | null): boolean {
  return target === document.body || (target instanceof Element && target.closest('canvas.view, .tree') !== null);
}
