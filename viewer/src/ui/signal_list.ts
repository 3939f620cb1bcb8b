// The list of every signal: a click makes a plot of one, dragging puts it over another.
import { GROUPS, type SignalStore } from '../signals/store';
import { checkbox, element, textButton } from './dom';
import { DRAGGED, type Plots } from './plots';

const MOST_SHOWN = 400;
const UPDATE_MS = 250;

/** What is rounding in any unit of the list is 0. */
const ROUNDING = 1e-12;

/** Nine characters at most. */
function short(value: number): string {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size < ROUNDING) return '0';
  return size < 1e-3 || size >= 1e6 ? value.toExponential(2) : String(Number(value.toPrecision(4)));
}

export class SignalList {
  private readonly list: HTMLElement;
  private readonly filter: HTMLInputElement;
  private readonly numbers = new Map<string, HTMLElement>();
  private stale = true;
  private drawn = 0;
  private readonly error: HTMLInputElement;

  constructor(
    private readonly page: HTMLElement,
    private readonly store: SignalStore,
    private readonly plots: Plots,
    actions: { save(): void; showPlots(): void; changed(): void; estimate(on: boolean): void },
  ) {
    this.filter = element('input', 'filter', page);
    this.filter.type = 'search';
    this.filter.placeholder = 'Find a signal';
    this.filter.setAttribute('aria-label', this.filter.placeholder);
    this.filter.addEventListener('input', () => (this.stale = true));
    element('p', 'hint', page).textContent = 'Click: a plot of its own. Shift-click, or drag onto a plot: with what that shows.';
    this.list = element('div', 'signals', page);
    this.error = checkbox('estimate the error', false, element('div', '', page), (on) => actions.estimate(on));
    const bar = element('div', 'bar', page);
    textButton('Plots', bar, actions.showPlots).title = 'Show the plots (P)';
    textButton('Save all as CSV', bar, actions.save).title = 'All signals since the start, ten minutes at most';
    store.onNew = () => (this.stale = true);
    plots.onChange = () => {
      this.stale = true;
      actions.changed();
    };
    this.act = (key, together) => {
      if (!plots.has(key)) actions.showPlots();
      if (together && plots.signals.length > 0) plots.overlay(plots.signals.length - 1, key);
      else plots.toggle(key);
    };
  }

  private readonly act: (key: string, together: boolean) => void;

  useSettings(error: boolean): void {
    this.error.checked = error;
  }

  /** What only a running simulation computes. */
  setLive(on: boolean): void {
    this.error.disabled = !on;
  }

  private build(): void {
    this.stale = false;
    this.numbers.clear();
    this.list.replaceChildren();
    const wanted = this.filter.value.trim().toLowerCase();
    let shown = 0;
    const { store } = this;
    for (const [group, title] of Object.entries(GROUPS)) {
      const signals = store.signals.filter(
        (s) => s.group === group && !s.beside && store.has(s.key) && (wanted === '' || `${s.title} ${title}`.toLowerCase().includes(wanted)),
      );
      if (signals.length === 0) continue;
      element('h3', '', this.list).textContent = title;
      for (const signal of signals) {
        if (++shown > MOST_SHOWN) continue;
        const row = element('button', 'signal', this.list);
        row.type = 'button';
        row.draggable = true;
        row.title = signal.title;
        row.dataset['key'] = signal.key;
        row.setAttribute('aria-pressed', String(this.plots.has(signal.key)));
        element('span', 'name', row).textContent = signal.title;
        this.numbers.set(signal.key, element('span', 'value', row));
        element('span', 'unit', row).textContent = signal.unit;
        row.addEventListener('click', (event) => this.act(signal.key, event.shiftKey));
        row.addEventListener('dragstart', (event) => event.dataTransfer?.setData(DRAGGED, signal.key));
      }
    }
    if (shown > MOST_SHOWN) element('p', 'more', this.list).textContent = `and ${shown - MOST_SHOWN} more: find them by name`;
  }

  draw(now: number): void {
    if (this.page.hidden || this.page.offsetParent === null || now - this.drawn < UPDATE_MS) return;
    this.drawn = now;
    if (this.stale) this.build();
    for (const [key, cell] of this.numbers) {
      const value = this.store.now(key);
      const text = short(value);
      if (cell.textContent !== text) cell.textContent = text;
    }
  }
}
