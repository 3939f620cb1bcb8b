// Title, state and the buttons that every viewer needs.
import { element, iconButton, setIcon } from './dom';

export interface BarActions {
  pause(): void;
  step(): void;
  reset(): void;
  home(): void;
  theme(): void;
}

export class Bar {
  readonly root: HTMLElement;
  readonly buttons: HTMLElement;
  private readonly heading: HTMLElement;
  private readonly state: HTMLElement;
  private readonly pauseButton: HTMLButtonElement;
  private readonly stepButton: HTMLButtonElement;
  private readonly resetButton: HTMLButtonElement;

  constructor(parent: HTMLElement, actions: BarActions) {
    this.root = element('div', 'head', parent);
    const title = element('div', 'title box', this.root);
    this.heading = element('h1', '', title);
    this.state = element('p', '', title);
    this.buttons = element('div', 'bar box', this.root);
    this.buttons.setAttribute('role', 'toolbar');
    this.pauseButton = iconButton('pause', 'Pause (space)', this.buttons, actions.pause);
    this.stepButton = iconButton('step', 'One frame (right arrow)', this.buttons, actions.step);
    this.resetButton = iconButton('reset', 'Reset (backspace)', this.buttons, actions.reset);
    iconButton('home', 'Whole model in view (F)', this.buttons, actions.home);
    iconButton('theme', 'Light or dark (T)', this.buttons, actions.theme);
  }

  setTitle(text: string): void {
    this.heading.textContent = text;
    this.heading.title = text;
    document.title = `${text} – FORK-1S`;
  }

  setState(text: string): void {
    if (this.state.textContent !== text) this.state.textContent = text;
  }

  setPaused(paused: boolean): void {
    setIcon(this.pauseButton, paused ? 'play' : 'pause', paused ? 'Go on (space)' : 'Pause (space)');
  }

  setEnabled(enabled: boolean): void {
    for (const button of [this.pauseButton, this.stepButton, this.resetButton]) button.disabled = !enabled;
  }
}
