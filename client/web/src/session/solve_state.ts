// What the page says of its server's solve: how far it is, what has failed, and that there is no scene. Part of the App.

import type { App } from '../app/app';
import type { Progress } from '../protocol/messages';
import { percent, readable } from '../page/numbers';
import { stateText } from '../ui/solve_panel';

interface Trouble {
  text: string;
  /** What mends it, or shows what there is. */
  label: string;
  act(): void;
}

export class StateSession {
  /** Why the solve of the scene that is there has failed, as the page says it. */
  private trouble: string | undefined;

  constructor(private readonly app: App) {}

  /** It was that of a server which may have started again. */
  forgetTrouble(): void {
    this.trouble = undefined;
    this.app.frame.setBanner('solve', undefined);
  }

  /** Once more, as the picture has changed. */
  again(): void {
    if (this.app.progress) this.show(this.app.progress);
  }

  show(progress: Progress): void {
    const { frame } = this.app;
    this.settleLight();
    const isOver = ['converged', 'timeLimit', 'limited'].includes(progress.state);
    const done = isOver && !this.isLightUnderWay(progress);
    const bad = progress.state === 'failed';
    const isBusy = isOver || progress.state === 'solving';
    const stated = hasScene(progress) && progress.state !== 'loading';
    const error = !stated ? '' : progress.unlit ? 'no light arrives' : `${percent(progress.error.total)} error`;
    const rate = progress.state === 'solving' ? `${readable(progress.shotsPerSecond, 2)} shots/s` : '';
    frame.setState(
      isOver && !done
        ? 'Receiving light'
        : isFirstLight(progress) && this.app.viewer.shown
          ? 'First light'
          : stateText(progress),
      bad ? 'bad' : done ? (progress.state === 'converged' ? 'good' : 'short') : isBusy ? 'busy' : 'idle',
      error,
      rate,
    );
    frame.setWelcome(hasScene(progress) && bad ? '' : progress.state, progress.failure, progress.fraction);
    this.showTrouble(progress, isOver);
  }

  /** Black is no light yet as long as the solve goes on, or its last tiles are still to come. */
  settleLight(): void {
    const { progress, viewer } = this.app;
    if (!progress || !viewer.set || viewer.dataSet || viewer.set.note.revision > progress.revision) return;
    const goesOn = ['empty', 'loading', 'solving'].includes(progress.state);
    if (!goesOn && !this.isLightUnderWay(progress)) viewer.settleLight();
  }

  /** The solve is over before its last tiles are here, and they before they are in the picture. */
  private isLightUnderWay({ tileVersion }: Progress): boolean {
    const { bookmark, viewer } = this.app;
    const streamed = viewer.dataSet ?? viewer.set;
    if (!streamed) return false;
    // All quantities that anybody looks at are published by the same versions.
    const isHere = bookmark?.quantity === streamed.quantity && bookmark.tileVersion >= tileVersion;
    return !isHere || streamed.waiting > 0;
  }

  /**
   * What there is to see stays to be looked at; that no light comes after it, or that there is none, is said for as long
   * as it holds.
   */
  private showTrouble(progress: Progress, isOver: boolean): void {
    const trouble = hasScene(progress) ? this.troubleOf(progress, isOver) : undefined;
    if (trouble?.text === this.trouble) return;
    this.trouble = trouble?.text;
    this.app.frame.setBanner('solve', trouble?.text, trouble?.label, trouble?.act);
  }

  private troubleOf(progress: Progress, isOver: boolean): Trouble | undefined {
    const { edit, view, viewer } = this.app;
    const { failure = 'the server gave no reason' } = progress;
    if (progress.state === 'failed')
      return { text: `The solve failed: ${failure}.`, label: 'Restart', act: () => void this.app.ask('solve.restart') };
    if (!isOver) return undefined;
    if (progress.energy['emitted'] === 0)
      return {
        text: 'Nothing shines in this scene, so that all of it is dark.',
        label: 'Add a lamp',
        act: () => void edit.addLamp(),
      };
    // A file without materials has the one that glTF gives it, a metal.
    if (view.mode.id === 'lit' && viewer.shown?.isBlack)
      return {
        text: 'All surfaces are metal, or black, and reflect no light that a lightmap could hold.',
        label: 'Show irradiance',
        act: () => void view.setMode('irradiance'),
      };
    return undefined;
  }
}

/** Nothing is stated of a scene that is not all there; while another is loaded, all that is stated is of the present one. */
function isFirstLight({ state, surfaces }: Progress): boolean {
  return state === 'loading' && surfaces === 0;
}

/** `failed` may mean both: that a scene is not solved further, and that there is none. */
export function hasScene({ state, surfaces }: Progress): boolean {
  return state !== 'empty' && (state !== 'failed' || surfaces > 0);
}
