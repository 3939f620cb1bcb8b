// Compliance ellipsoids as numbers: what a drag asks for, what was reached, what is possible, and the way back.
import type { Request } from '../net/live';
import type { ShapedMessage, TunableInfo } from '../wire/messages';
import { decimalField, formatDecimal } from './decimal';
import { element, textButton } from './dom';

const FIRST_FACTOR = 10;
const MOST_FACTOR = 1000; // as the program has it

export type Vector = readonly [number, number, number];

/** uᵀ C u of C = xx yy zz xy xz yz. */
export function along(C: readonly number[], [x, y, z]: Vector): number {
  const [xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0] = C;
  return xx * x * x + yy * y * y + zz * z * z + 2 * (xy * x * y + xz * x * z + yz * y * z);
}

export interface ShapeActions {
  send(request: Request): void;
  tunables(): readonly TunableInfo[];
  nameOf(body: number): string;
}

export class ShapeCard {
  private factor = FIRST_FACTOR;
  private u: Vector = [0, 0, 1]; // of the last drag, axes of the root
  private before: (number | null)[] = []; // values of all tunables when the drag began
  private asked = false; // since then
  private readonly past: (number | null)[][] = [];
  private readonly bounds: HTMLElement;
  private readonly numbers: HTMLElement;
  private readonly back: HTMLButtonElement;

  constructor(
    page: HTMLElement,
    private readonly actions: ShapeActions,
  ) {
    const card = element('div', 'shape', page);
    element('p', 'hint', card).textContent = 'Compliance ellipsoids (View) can be dragged into another shape.';
    const row = element('label', 'factor', card);
    row.append('stiffness changes by at most ×');
    const field = decimalField('greatest factor on a stiffness', row, (value) => {
      this.factor = value > 1 && value <= MOST_FACTOR ? value : this.factor;
      field.setAttribute('aria-invalid', String(this.factor !== value));
      this.showBounds();
    });
    field.value = String(FIRST_FACTOR);
    this.bounds = element('p', 'hint bounds', card);
    this.numbers = element('div', 'reached', card);
    this.numbers.setAttribute('role', 'status');
    this.back = textButton('Undo the last drag', element('div', 'bar', card), () => this.undo());
    this.back.disabled = true;
    this.showBounds();
  }

  private showBounds(): void {
    const f = formatDecimal(this.factor);
    this.bounds.textContent = `Each joint's and servo's stiffness stays between 1/${f} and ${f} times the file's.`;
  }

  /** An ellipsoid was grabbed. */
  begin(): void {
    this.before = this.actions.tunables().map((item) => item.value);
    this.asked = false;
  }

  /** A body's compliance [m/N] is to be C; it is dragged along u. Both in the axes of its root. */
  ask(body: number, C: readonly number[], u: Vector): void {
    if (!this.asked) this.past.push(this.before);
    this.asked = true;
    this.back.disabled = false;
    this.u = u;
    this.actions.send({ type: 'shape', body, compliance: [...C], factor: this.factor });
  }

  use(message: ShapedMessage): void {
    const text = (C: readonly number[]): string => String(Number((1000 * along(C, this.u)).toPrecision(3)));
    this.numbers.replaceChildren();
    element('h3', '', this.numbers).textContent = `${this.actions.nameOf(message.body)}, along the drag`;
    const list = element('dl', '', this.numbers);
    const lines: [string, string][] = [
      ['asked', `${text(message.asked)} mm/N`],
      ['reached', `${text(message.reached)} mm/N`],
      ['possible', `${text(message.stiffest)} to ${text(message.softest)} mm/N`],
      ['at a bound', `${message.at_bound} of ${message.stiffnesses} stiffnesses`],
    ];
    for (const [name, value] of lines) {
      element('dt', '', list).textContent = name;
      element('dd', '', list).textContent = value;
    }
  }

  private undo(): void {
    const values = this.past.pop();
    this.back.disabled = this.past.length === 0;
    this.numbers.replaceChildren();
    this.actions.tunables().forEach((item, index) => {
      const value = values?.[index];
      if (value !== null && value !== undefined && value !== item.value) this.actions.send({ type: 'set', setting: 'tune', index, value });
    });
  }

  /** Of another model. */
  clear(): void {
    this.past.length = 0;
    this.back.disabled = true;
    this.numbers.replaceChildren();
  }
}
