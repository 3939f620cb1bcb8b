// What went wrong, as whole sentences that stay until they are closed or no longer true. One a subject.
import { element } from './dom';

export type Subject = 'file' | 'request' | 'run' | 'ghost';

const HEADINGS: Record<Subject, string> = {
  file: 'The file as it is now cannot be used; the model read before goes on',
  request: 'Not done; the model goes on as it was',
  run: 'Paused',
  ghost: 'The full simulation stopped',
};

export class Problems {
  private readonly root: HTMLElement;
  private readonly boxes = new Map<Subject, HTMLElement>();

  constructor(parent: HTMLElement) {
    this.root = element('div', 'problems', parent);
  }

  /** Replaces what was said about the same subject; an empty sentence takes it away. */
  say(subject: Subject, sentence: string): void {
    this.clear(subject);
    if (sentence === '') return;
    const box = element('div', 'problem box', this.root);
    box.setAttribute('role', 'alert');
    box.dataset['about'] = subject;
    const text = element('div', '', box);
    element('h2', '', text).textContent = HEADINGS[subject];
    element('p', '', text).textContent = sentence;
    const close = element('button', '', box);
    close.type = 'button';
    close.textContent = '×';
    close.title = 'Close (Esc)';
    close.setAttribute('aria-label', 'Close');
    close.addEventListener('click', () => this.clear(subject));
    this.boxes.set(subject, box);
  }

  clear(...subjects: Subject[]): void {
    for (const subject of subjects) {
      this.boxes.get(subject)?.remove();
      this.boxes.delete(subject);
    }
  }

  clearAll(): void {
    this.clear(...this.boxes.keys());
  }
}
