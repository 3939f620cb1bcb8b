// Sentences to the user: passing ones on top, and one that covers the page while there is nothing to see.
import { element } from './dom';

const SHOWN_FOR = 6000; // ms
const MOST_SHOWN = 3;

export class Notices {
  private readonly list: HTMLElement;
  private readonly cover: HTMLElement;
  private readonly heading: HTMLElement;
  private readonly text: HTMLElement;

  /** `passing`: where sentences stand that pass. */
  constructor(parent: HTMLElement, passing: HTMLElement = parent) {
    this.list = element('div', 'notices', passing);
    this.list.setAttribute('role', 'status');
    this.cover = element('div', 'cover', parent);
    this.cover.hidden = true;
    const box = element('div', 'box', this.cover);
    box.setAttribute('role', 'alert');
    this.heading = element('h2', '', box);
    this.text = element('p', '', box);
  }

  say(sentence: string): void {
    const existing = [...this.list.children].find((n) => n.textContent === sentence);
    existing?.remove();
    const box = element('div', 'notice box', this.list);
    box.textContent = sentence;
    while (this.list.childElementCount > MOST_SHOWN) this.list.firstElementChild?.remove();
    setTimeout(() => box.remove(), SHOWN_FOR);
  }

  /** As many as there is room for; the last one counts the others. */
  sayAll(sentences: readonly string[]): void {
    const room = sentences.length > MOST_SHOWN ? MOST_SHOWN - 1 : MOST_SHOWN;
    sentences.slice(0, room).forEach((sentence) => this.say(sentence));
    if (sentences.length > room) this.say(`… and ${sentences.length - room} more; fork1s run tells all`);
  }

  coverWith(heading: string, text: string): void {
    this.heading.textContent = heading;
    this.text.textContent = text;
    this.cover.hidden = false;
  }

  uncover(): void {
    this.cover.hidden = true;
  }
}
