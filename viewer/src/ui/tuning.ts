// Gains, dampings, limits, masses and friction, changed while the simulation runs and kept in a copy of its file.
import type { Request } from '../net/live';
import type { SceneMessage, TunableInfo, TuningMessage, WrittenMessage } from '../wire/messages';
import { checkbox, element, textButton } from './dom';
import { ShapeCard } from './shape_card';
import { decimalField, formatDecimal } from './decimal';

const MOST_SHOWN = 300;
const SEND_MS = 80; // between two requests for the same number: each builds the model again

const WORDS: Record<string, string> = {
  stiffness: 'stiffness',
  damping: 'damping',
  lower: 'lower limit',
  upper: 'upper limit',
  dry_friction: 'dry friction',
  force_lower: 'least force',
  force_upper: 'greatest force',
  mass: 'mass',
  friction: 'friction',
};

export class Tuning {
  readonly shape: ShapeCard;
  private readonly filter: HTMLInputElement;
  private readonly only: HTMLInputElement;
  private readonly list: HTMLElement;
  private readonly result: HTMLElement;
  private readonly write: HTMLButtonElement;
  private items: readonly TunableInfo[] = [];
  private names = ''; // that the fields were made for
  private readonly fields = new Map<number, { field: HTMLInputElement; row: HTMLElement }>();
  private scene: SceneMessage | null = null;
  private readonly waiting = new Map<number, number>();
  private sending = false;

  constructor(
    page: HTMLElement,
    private readonly actions: { send(request: Request): void; selected(): string | null },
  ) {
    this.filter = element('input', 'filter', page);
    this.filter.type = 'search';
    this.filter.placeholder = 'Find a joint, actuator or body';
    this.filter.setAttribute('aria-label', this.filter.placeholder);
    this.filter.addEventListener('input', () => this.build());
    this.only = checkbox('only what is chosen in the scene', false, page, () => this.build());
    this.shape = new ShapeCard(page, {
      send: actions.send,
      tunables: () => this.items,
      nameOf: (body) => this.scene?.bodies[body]?.name ?? '',
    });
    this.list = element('div', 'numbers', page);
    const bar = element('div', 'bar', page);
    this.write = textButton('Write these into a copy of my file', bar, () => {
      this.result.textContent = 'writing …';
      actions.send({ type: 'write', tuned: true, moment: -1, text_only: false });
    });
    textButton('Reset all', bar, () => {
      this.items.forEach((item, i) => item.value !== item.original && item.original !== null && this.send(i, item.original));
    });
    this.result = element('div', 'result', page);
    this.result.setAttribute('role', 'status');
  }

  /** All that can be tuned, as the program last told them. */
  get numbers(): readonly TunableInfo[] {
    return this.items;
  }

  useScene(scene: SceneMessage): void {
    this.scene = scene;
  }

  use(message: TuningMessage): void {
    this.items = message.items;
    const names = JSON.stringify(message.items.map((item) => [item.of, item.owner, item.quantity]));
    if (names !== this.names) {
      this.names = names;
      this.shape.clear();
      this.build();
    } else this.refresh();
    const changed = message.items.filter((item) => item.value !== item.original).length;
    this.write.disabled = changed === 0 || !message.writes;
    this.write.title = changed === 0 ? 'Nothing differs from the file' : `${changed} numbers differ from the file`;
  }

  /** What was written, or what could not be. */
  written(message: WrittenMessage): void {
    this.result.replaceChildren();
    element('p', '', this.result).textContent = `Written: ${message.path}`;
    if (message.notes.length === 0) return;
    const list = element('ul', '', this.result);
    for (const note of message.notes) element('li', '', list).textContent = note;
  }

  /** Another body was chosen. */
  chosen(): void {
    if (this.only.checked) this.build();
  }

  /** Names of the chosen body, its joints and what moves them. */
  private around(): Set<string> | null {
    const name = this.actions.selected();
    const { scene } = this;
    if (!this.only.checked || name === null || !scene) return null;
    const body = scene.bodies.findIndex((b) => b.name === name);
    const names = new Set([`body ${name}`]);
    scene.joints.forEach((joint, j) => {
      if (joint.body !== body) return;
      names.add(`joint ${joint.name}`);
      for (let i = 0; i < joint.size; ++i) names.add(`joint ${joint.name}.${i}`);
      for (const control of scene.controls) if (control.joints.includes(j)) names.add(`actuator ${control.name}`);
    });
    return names;
  }

  private build(): void {
    this.fields.clear();
    this.list.replaceChildren();
    const wanted = this.filter.value.trim().toLowerCase();
    const around = this.around();
    let owner = '';
    this.items.forEach((item, i) => {
      const title = `${item.of} ${item.owner}`;
      if (wanted !== '' && !title.toLowerCase().includes(wanted)) return;
      if (around && !around.has(title)) return;
      if (this.fields.size >= MOST_SHOWN) return;
      if (title !== owner) {
        owner = title;
        const head = element('h3', '', this.list);
        head.textContent = item.owner || 'without a name';
        element('span', 'detail', head).textContent = item.of;
      }
      const row = element('div', 'number', this.list);
      const word = element('span', 'name', row);
      word.textContent = WORDS[item.quantity] ?? item.quantity;
      word.title = 'Drag to change';
      const field = decimalField(`${WORDS[item.quantity] ?? item.quantity} of ${title}`, row, (value) => this.send(i, value));
      this.dragged(word, i);
      element('span', 'unit', row).textContent = item.unit;
      const back = element('button', 'back', row);
      back.type = 'button';
      back.textContent = '↺';
      back.setAttribute('aria-label', `As in the file: ${formatDecimal(item.original)}`);
      back.addEventListener('click', () => item.original !== null && this.send(i, item.original));
      this.fields.set(i, { field, row });
    });
    if (this.fields.size >= MOST_SHOWN) element('p', 'more', this.list).textContent = 'and more: find them by name';
    if (this.fields.size === 0) element('p', 'hint', this.list).textContent = 'Nothing of that name can be tuned.';
    this.refresh();
  }

  private refresh(): void {
    for (const [i, { field, row }] of this.fields) {
      const item = this.items[i];
      if (!item) continue;
      if (document.activeElement !== field || !this.waiting.has(i)) field.value = formatDecimal(item.value);
      field.placeholder = item.value === null ? 'none' : '';
      row.classList.toggle('changed', item.value !== item.original);
    }
  }

  /** Sideways over its name: ten times a number each 200 pixels. */
  private dragged(handle: HTMLElement, i: number): void {
    let from: { x: number; value: number } | null = null;
    handle.addEventListener('pointerdown', (event) => {
      const value = this.items[i]?.value;
      if (value === null || value === undefined) return;
      from = { x: event.clientX, value: value === 0 ? 0.01 : value };
      handle.setPointerCapture(event.pointerId);
    });
    handle.addEventListener('pointermove', (event) => {
      if (!from) return;
      const value = from.value * 10 ** ((event.clientX - from.x) / 200);
      const shown = this.fields.get(i);
      if (shown) shown.field.value = formatDecimal(value);
      this.send(i, value);
    });
    for (const name of ['pointerup', 'pointercancel'] as const) handle.addEventListener(name, () => (from = null));
  }

  private send(i: number, value: number): void {
    this.waiting.set(i, value);
    if (this.sending) return;
    this.flush();
  }

  private flush(): void {
    this.sending = this.waiting.size > 0;
    if (!this.sending) return;
    for (const [index, value] of this.waiting) this.actions.send({ type: 'set', setting: 'tune', index, value });
    this.waiting.clear();
    setTimeout(() => this.flush(), SEND_MS);
  }
}
