// A moment to keep: as the text of a keyframe, and in a copy of the file.
import type { Request } from '../net/live';
import type { WrittenMessage } from '../wire/messages';
import { element, textButton } from './dom';

export class MomentCard {
  private readonly card: HTMLElement;
  private readonly text: HTMLTextAreaElement;
  private readonly note: HTMLElement;
  private moment = 0;
  private before: Element | null = null; // that had the focus

  constructor(
    parent: HTMLElement,
    private readonly send: (request: Request) => void,
  ) {
    this.card = element('div', 'dialog box', parent);
    this.card.hidden = true;
    this.card.setAttribute('role', 'dialog');
    this.card.setAttribute('aria-label', 'Keep this moment');
    element('h2', '', this.card).textContent = 'This moment as a keyframe';
    this.text = element('textarea', '', this.card);
    this.text.readOnly = true;
    this.text.rows = 6;
    this.text.setAttribute('aria-label', 'Keyframe text');
    this.note = element('div', 'result', this.card);
    this.note.setAttribute('role', 'status');
    const bar = element('div', 'bar', this.card);
    textButton('Select the text', bar, () => {
      this.text.focus();
      this.text.select();
    });
    textButton('Write into a copy of my file', bar, () =>
      this.send({ type: 'write', tuned: true, moment: this.moment, text_only: false }),
    ).title = 'MODEL_tuned.xml beside the file, which stays as it is';
    textButton('Close', bar, () => this.close()).title = 'Close (Esc)';
  }

  /** Asks for a moment: a frame's sequence, or 0 for the present. */
  ask(moment: number): void {
    this.moment = moment;
    this.before = document.activeElement;
    this.note.replaceChildren();
    this.text.value = '';
    this.send({ type: 'write', tuned: false, moment, text_only: true });
  }

  get open(): boolean {
    return !this.card.hidden;
  }

  use(message: WrittenMessage): void {
    if (this.card.hidden) {
      this.card.hidden = false;
      this.text.focus();
    }
    this.text.value = message.text;
    this.note.replaceChildren();
    if (!message.path) return;
    element('p', '', this.note).textContent = `Written: ${message.path}`;
    for (const note of message.notes) element('p', '', this.note).textContent = note;
  }

  close(): void {
    this.card.hidden = true;
    if (this.before instanceof HTMLElement) this.before.focus();
  }
}
