// Title, state and the buttons that every viewer needs.
import type { GhostFrame, SceneMessage } from '../wire/messages';
import { element, iconButton, setIcon } from './dom';

/** Behind by less than this [s] is no more than frames on their way. */
const NOTICEABLE = 0.1;

export function ghostText(ghost: GhostFrame | null, scene: SceneMessage | null): string {
  if (!ghost) return 'full simulation: starting';
  const mm = 1000 * ghost.distance;
  const worst = scene?.bodies[ghost.body]?.name;
  const away = mm < 0.01 ? 'less than 0.01' : mm >= 100 ? mm.toFixed(0) : mm.toPrecision(2);
  const parts = [`full simulation: ${away} mm away${worst ? ` at ${worst}` : ''}`];
  if (ghost.behind > NOTICEABLE) parts.push(`ghost ${ghost.behind.toFixed(1)} s behind`);
  return parts.join('  ·  ');
}

export interface BarActions {
  pause(): void;
  step(): void;
  reset(): void;
  home(): void;
  theme(): void;
  record(): void;
  plots(): void;
  pick(): void;
  side(): void;
  past(): void;
  keep(): void;
  help(): void;
}

export class Bar {
  readonly root: HTMLElement;
  private readonly heading: HTMLElement;
  private readonly state: HTMLElement;
  private readonly ghost: HTMLElement;
  private readonly pauseButton: HTMLButtonElement;
  private readonly stepButton: HTMLButtonElement;
  private readonly resetButton: HTMLButtonElement;
  private readonly pastButton: HTMLButtonElement;
  private readonly keepButton: HTMLButtonElement;
  private readonly recordButton: HTMLButtonElement;
  private readonly pickButton: HTMLButtonElement;
  private readonly plotsButton: HTMLButtonElement;
  private readonly sideButton: HTMLButtonElement;

  constructor(parent: HTMLElement, actions: BarActions) {
    this.root = element('div', 'head', parent);
    const title = element('div', 'title box', this.root);
    this.heading = element('h1', '', title);
    this.state = element('p', '', title);
    this.ghost = element('p', 'ghost', title);
    this.ghost.hidden = true;
    const bar = element('div', 'bar box', this.root);
    bar.setAttribute('role', 'toolbar');
    bar.setAttribute('aria-label', 'Simulation and view');
    const group = (name: string): HTMLElement => {
      const outer = element('div', 'group', bar);
      outer.setAttribute('role', 'group');
      outer.setAttribute('aria-label', name);
      element('span', 'name', outer).textContent = name;
      return element('div', 'buttons', outer);
    };
    const run = group('Simulation');
    this.pauseButton = iconButton('pause', 'Pause (space)', run, actions.pause);
    this.stepButton = iconButton('step', 'One frame (right arrow)', run, actions.step);
    this.resetButton = iconButton('reset', 'Reset (backspace)', run, actions.reset);
    this.pastButton = iconButton('past', 'The last minute (left arrow)', run, actions.past);
    const keep = group('Keep');
    this.keepButton = iconButton('save', 'Keep this moment (K)', keep, actions.keep);
    this.recordButton = iconButton('record', 'Record (R)', keep, actions.record);
    const model = group('Model');
    this.pickButton = iconButton('pick', 'Pick the interface bodies (I)', model, actions.pick);
    this.sideButton = iconButton('tree', 'Model, tuning, signals (M, U, L)', model, actions.side);
    this.plotsButton = iconButton('plots', 'Plots (P)', model, actions.plots);
    const look = group('View');
    iconButton('home', 'Whole model in view (F)', look, actions.home);
    iconButton('theme', 'Light or dark (T)', look, actions.theme);
    iconButton('help', 'Keys (?)', look, actions.help);
  }

  setTitle(text: string): void {
    this.heading.textContent = text;
    this.heading.title = text;
    document.title = `${text} – FORK-1S`;
  }

  setState(text: string): void {
    if (this.state.textContent !== text) this.state.textContent = text;
  }

  /** The line about the full simulation; empty: none. */
  setGhost(text: string): void {
    this.ghost.hidden = text === '';
    if (this.ghost.textContent !== text) this.ghost.textContent = text;
  }

  setPaused(paused: boolean): void {
    setIcon(this.pauseButton, paused ? 'play' : 'pause', paused ? 'Go on (space)' : 'Pause (space)');
  }

  private get liveButtons(): HTMLButtonElement[] {
    return [this.pauseButton, this.stepButton, this.resetButton, this.pastButton, this.keepButton, this.recordButton, this.pickButton];
  }

  setEnabled(enabled: boolean): void {
    for (const button of this.liveButtons)
      button.disabled = !enabled;
  }

  /** A recording has a timeline of its own; what only a running simulation can do goes away. */
  setReplay(on: boolean, live: boolean): void {
    for (const button of this.liveButtons) {
      button.disabled = false;
      button.hidden = on;
    }
    if (!live) this.root.classList.add('file');
  }

  setRecording(on: boolean): void {
    setIcon(this.recordButton, on ? 'stop' : 'record', on ? 'End the recording (R)' : 'Record (R)');
    this.recordButton.setAttribute('aria-pressed', String(on));
  }

  setPicking(on: boolean): void {
    this.pickButton.setAttribute('aria-pressed', String(on));
  }

  setSide(on: boolean): void {
    this.sideButton.setAttribute('aria-pressed', String(on));
  }

  setPlots(on: boolean): void {
    this.plotsButton.setAttribute('aria-pressed', String(on));
  }
}
