// Keys and gestures on one card.
import { element } from './dom';

const LINES: [string, string][] = [
  ['drag a body', 'pull it by a spring'],
  ['click a body', 'push it'],
  ['drag beside', 'turn the camera; wheel zooms, right button shifts'],
  ['space', 'pause, go on'],
  ['→', 'one frame'],
  ['←', 'the last minute: scrub, resume from there'],
  ['K', 'keep this moment as a keyframe'],
  ['backspace', 'reset'],
  ['R', 'record; again: look at the recording'],
  ['M, U, L', 'model tree, tuning, list of signals; a click then chooses a body, shift-click pushes'],
  ['I', 'pick the interface bodies'],
  ['P', 'plots'],
  ['S', 'settings'],
  ['F', 'whole model in view'],
  ['T', 'light or dark'],
  ['esc', 'leaves what is open: this card, a dialog, a text field, picking, a recording'],
  ['enter', 'for the button or checkbox that has the focus'],
  ['?', 'this card'],
];

export class Help {
  private readonly card: HTMLElement;

  constructor(parent: HTMLElement) {
    this.card = element('div', 'help box', parent);
    this.card.hidden = true;
    const list = element('dl', '', this.card);
    for (const [key, meaning] of LINES) {
      element('dt', '', list).textContent = key;
      element('dd', '', list).textContent = meaning;
    }
    this.card.addEventListener('click', () => this.close());
  }

  get shown(): boolean {
    return !this.card.hidden;
  }

  toggle(): void {
    this.card.hidden = !this.card.hidden;
  }

  close(): void {
    this.card.hidden = true;
  }
}
