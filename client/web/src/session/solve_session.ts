// The solve as the panel "Solve" shows and steers it.

import type { Server } from '../protocol/connection';
import type { Progress, ServerInfo, Settings, SolveHistory, Status } from '../protocol/messages';
import { SolvePanel } from '../ui/solve_panel';
import type { Told } from './told';

/** A call whose refusal is shown to the user; the promise then ends with undefined. */
export type Ask = <T>(method: string, params?: object) => Promise<T | undefined>;

export interface SolveEvents {
  settings(settings: Settings): void;
  progress(progress: Progress): void;
  notAccepted(text: string, wanted: string): void;
}

export class SolveSession {
  readonly panel: SolvePanel;

  constructor(
    private readonly server: Server,
    private readonly ask: Ask,
    private readonly told: Pick<Told, 'progress'>,
    private readonly events: SolveEvents,
  ) {
    this.panel = new SolvePanel({
      pauseOrResume: () => this.pauseOrResume(),
      restart: () => this.restart(),
      configure: (settings) => void this.configure(settings),
      notAccepted: (text, wanted) => events.notAccepted(text, wanted),
    });
  }

  onProgress(progress: Progress): void {
    this.told.progress = progress;
    this.panel.update(progress);
    this.events.progress(progress);
  }

  onSettings(settings: Settings): void {
    this.panel.setSettings(settings);
    this.events.settings(settings);
  }

  async fetchStatus(): Promise<void> {
    const status = await this.server.call<Status>('status').catch(() => undefined);
    if (!status) return;
    this.onSettings(status.settings);
    this.panel.setWarnings(status.warnings, status.warningCount);
    this.onProgress(status);
  }

  /** Comes after the status, which tells the plot whether its samples are of this solve. */
  async fetchHistory(info: ServerInfo): Promise<void> {
    if (!this.server.has('solve.history')) return;
    const history = await this.server.call<SolveHistory>('solve.history').catch(() => undefined);
    if (history && info === this.server.info) this.panel.setHistory(history.samples);
  }

  restart(): void {
    void this.ask('solve.restart');
  }

  togglePause(): void {
    if (this.told.progress?.state === 'paused' || this.told.progress?.state === 'solving') this.pauseOrResume();
  }

  private pauseOrResume(): void {
    void this.ask(this.told.progress?.state === 'paused' ? 'solve.resume' : 'solve.pause');
  }

  private async configure(settings: Partial<Settings>): Promise<void> {
    const all = await this.ask<Settings>('solve.configure', settings);
    if (all) this.onSettings(all);
    else this.panel.showSettings();
  }
}
