// What the page says of the solve: how far it is, what has failed, and that there is no scene.

import { percent, readable } from '../page/numbers';
import type { Progress } from '../protocol/messages';
import type { Frame } from '../ui/frame';
import { stateText } from '../ui/solve_panel';
import type { ViewMode } from '../view/looks/view_modes';
import type { Viewer } from '../view/viewer';
import type { Told } from './told';

/** What the user can do about a trouble. */
export interface Remedies {
  restart(): void;
  addLamp(): void;
  showIrradiance(): void;
}

interface Trouble {
  text: string;
  /** Names the remedy. */
  label: string;
  act(): void;
}

export class SolveState {
  /** Text of the trouble that is shown. */
  private trouble: string | undefined;

  constructor(
    private readonly told: Readonly<Told>,
    private readonly picture: Pick<Viewer, 'shown' | 'set' | 'dataSet' | 'settleLight'>,
    private readonly frame: Pick<Frame, 'setState' | 'setWelcome' | 'setBanner'>,
    private readonly mode: () => ViewMode,
    private readonly remedies: Remedies,
  ) {}

  /** The server may have restarted: its trouble may be over. */
  forgetTrouble(): void {
    this.trouble = undefined;
    this.frame.setBanner('solve', undefined);
  }

  /** The picture has changed, and the state that the page shows depends on the picture. */
  again(): void {
    if (this.told.progress) this.show(this.told.progress);
  }

  show(progress: Progress): void {
    this.settleLight();
    const isOver = ['converged', 'timeLimit', 'limited'].includes(progress.state);
    const done = isOver && !this.isLightUnderWay(progress);
    const bad = progress.state === 'failed';
    const isBusy = isOver || progress.state === 'solving';
    const stated = hasScene(progress) && progress.state !== 'loading';
    const error = !stated ? '' : progress.unlit ? 'no light arrives' : `${percent(progress.error.total)} error`;
    const rate = progress.state === 'solving' ? `${readable(progress.shotsPerSecond, 2)} shots/s` : '';
    this.frame.setState(
      isOver && !done
        ? 'Receiving light'
        : isFirstLight(progress) && this.picture.shown
          ? 'First light'
          : stateText(progress),
      bad ? 'bad' : done ? (progress.state === 'converged' ? 'good' : 'short') : isBusy ? 'busy' : 'idle',
      error,
      rate,
    );
    this.frame.setWelcome(hasScene(progress) && bad ? '' : progress.state, progress.failure, progress.fraction);
    this.showTrouble(progress, isOver);
  }

  /** As long as the solve goes on, or its last tiles are still to come, black means that there is no light yet. */
  settleLight(): void {
    const { picture } = this;
    const { progress } = this.told;
    if (!progress || !picture.set || picture.dataSet || picture.set.note.revision > progress.revision) return;
    const goesOn = ['empty', 'loading', 'solving'].includes(progress.state);
    if (!goesOn && !this.isLightUnderWay(progress)) picture.settleLight();
  }

  /** The solve ends before its last tiles arrive, and these arrive before they are in the picture. */
  private isLightUnderWay({ tileVersion }: Progress): boolean {
    const { bookmark } = this.told;
    const streamed = this.picture.dataSet ?? this.picture.set;
    if (!streamed) return false;
    // The server counts the versions of all streamed quantities together.
    const isHere = bookmark?.quantity === streamed.quantity && bookmark.tileVersion >= tileVersion;
    return !isHere || streamed.waiting > 0;
  }

  /**
   * The picture stays. The banner says that there is no light, or that no more will come, for as long as that holds.
   */
  private showTrouble(progress: Progress, isOver: boolean): void {
    const trouble = hasScene(progress) ? this.troubleOf(progress, isOver) : undefined;
    if (trouble?.text === this.trouble) return;
    this.trouble = trouble?.text;
    this.frame.setBanner('solve', trouble?.text, trouble?.label, trouble?.act);
  }

  private troubleOf(progress: Progress, isOver: boolean): Trouble | undefined {
    const { failure = 'the server gave no reason' } = progress;
    if (progress.state === 'failed')
      return { text: `The solve failed: ${failure}.`, label: 'Restart', act: () => this.remedies.restart() };
    if (!isOver) return undefined;
    if (progress.energy['emitted'] === 0)
      return {
        text: 'Nothing shines in this scene, so all of it is dark.',
        label: 'Add a lamp',
        act: () => this.remedies.addLamp(),
      };
    // A file without materials gets glTF's default material, which is a metal.
    if (this.mode().id === 'lit' && this.picture.shown?.isBlack)
      return {
        text: 'All surfaces are metal, or black, and reflect no light that a lightmap could hold.',
        label: 'Show irradiance',
        act: () => this.remedies.showIrradiance(),
      };
    return undefined;
  }
}

/** The server shows the first light of a scene that is still loading; then it states nothing else about that scene. */
function isFirstLight({ state, surfaces }: Progress): boolean {
  return state === 'loading' && surfaces === 0;
}

/** `failed` means that the solve of a scene has failed, or that there is no scene. */
export function hasScene({ state, surfaces }: Progress): boolean {
  return state !== 'empty' && (state !== 'failed' || surfaces > 0);
}
