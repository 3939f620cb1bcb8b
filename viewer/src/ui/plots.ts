// A strip of plots over the last seconds: each shows one signal or several over each other.
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import type { SignalStore } from '../signals/store';
import { element, iconButton, setIcon } from './dom';

const SPAN = 10; // s
const SHARE = 0.12; // of the page's height
const LEAST_HEIGHT = 84;
const LEAST_DRAG = 4; // pixels
const FIRST_TOGETHER = 3; // of a kind
/** Colours of the curves of a plot, as variables of the theme. */
const COLORS = ['--accent', '--curve-2', '--curve-3', '--curve-4', '--curve-5', '--curve-6'];
export const DRAGGED = 'text/x-fork1s-signal';

/** What a page begins with: joints, contact, bases, energy. */
function firstPlots(store: SignalStore): string[][] {
  const kind = (group: string): string[] => {
    const all = store.signals.filter((s) => s.group === group && store.has(s.key));
    return all.filter((s) => s.unit === all[0]?.unit).slice(0, FIRST_TOGETHER).map((s) => s.key);
  };
  return [kind('position'), ['contact_force'], ['friction_use'], kind('base'), ['energy']].filter((keys) => keys.length > 0);
}

interface Cell {
  keys: string[];
  figure: HTMLElement;
  plot: uPlot;
}

export class Plots {
  readonly root: HTMLElement;
  private cells: Cell[] = [];
  private keys: string[][] = [];
  private begun = false; // the first plots have been chosen
  private paused = false;
  private zoom: [number, number] | null = null; // s
  private drawn = 0;
  private readonly pauseButton: HTMLButtonElement;
  private readonly wholeButton: HTMLButtonElement;
  /** Called when other signals are shown. */
  onChange: () => void = () => undefined;

  constructor(
    parent: HTMLElement,
    private readonly store: SignalStore,
    private readonly save: (name: string, text: string) => void,
  ) {
    this.root = element('section', 'plots box', parent);
    this.root.hidden = true;
    this.root.setAttribute('aria-label', 'Plots');
    const bar = element('div', 'bar', this.root);
    this.pauseButton = iconButton('pause', 'Hold the plots', bar, () => {
      this.paused = !this.paused;
      setIcon(this.pauseButton, this.paused ? 'play' : 'pause', this.paused ? 'Let the plots run' : 'Hold the plots');
    });
    iconButton('save', 'Save as CSV', bar, () => this.save('fork1s.csv', this.store.csv()));
    this.wholeButton = iconButton('home', 'Whole span of time (double click)', bar, () => this.setZoom(null));
    this.wholeButton.hidden = true;
    this.acceptDrops(this.root, (key) => this.toggle(key, true));
  }

  private acceptDrops(target: HTMLElement, take: (key: string) => void): void {
    target.addEventListener('dragover', (event) => {
      if (event.dataTransfer?.types.includes(DRAGGED)) event.preventDefault();
    });
    target.addEventListener('drop', (event) => {
      const key = event.dataTransfer?.getData(DRAGGED);
      if (!key) return;
      event.preventDefault();
      event.stopPropagation();
      take(key);
    });
  }

  get shown(): boolean {
    return !this.root.hidden;
  }

  /** What each plot shows. */
  get signals(): readonly (readonly string[])[] {
    return this.keys;
  }

  has(key: string): boolean {
    return this.keys.some((keys) => keys.includes(key));
  }

  /** A plot of its own for a signal and what is drawn with it, or none of it any more. */
  toggle(key: string, on = !this.has(key)): void {
    if (on === this.has(key)) return;
    const together = this.store.together(key);
    if (on) this.keys.push(together);
    else this.keys = this.keys.map((keys) => keys.filter((k) => !together.includes(k))).filter((keys) => keys.length > 0);
    this.rebuild();
  }

  /** Whether any plot shows a signal of this group. */
  shows(group: string): boolean {
    return this.shown && this.keys.some((keys) => keys.some((key) => this.store.find(key)?.group === group));
  }

  /** Over what a plot shows already. */
  overlay(plot: number, key: string): void {
    const keys = this.keys[plot];
    if (!keys || keys.includes(key)) return;
    keys.push(...this.store.together(key));
    this.rebuild();
  }

  private rebuild(): void {
    if (this.shown) this.build();
    this.drawn = 0;
    this.onChange();
  }

  show(on = !this.shown): void {
    this.root.hidden = !on;
    if (this.shown && this.cells.length === 0) this.build();
    this.begin();
    this.drawn = 0;
    this.onChange();
  }

  /** Chooses the first plots once it is known what there is to plot. */
  private begin(): void {
    if (this.begun || !this.shown || this.store.length === 0) return;
    this.begun = true;
    this.keys = [...firstPlots(this.store), ...this.keys];
    this.rebuild();
  }

  /** Colours are part of a plot: a change of theme builds them again. */
  build(): void {
    for (const { plot, figure } of this.cells) {
      plot.destroy();
      figure.remove();
    }
    const style = getComputedStyle(document.documentElement);
    const text = style.getPropertyValue('--faint').trim();
    const edge = style.getPropertyValue('--edge').trim();
    const colors = COLORS.map((name) => style.getPropertyValue(name).trim());
    const font = '10px system-ui, sans-serif';
    this.cells = this.keys.map((keys, at) => {
      const figure = element('figure', 'plot', this.root);
      const caption = element('figcaption', '', figure);
      const names = element('div', 'names', caption);
      keys.forEach((key, i) => {
        const signal = this.store.find(key);
        const label = element('span', '', names);
        const prefix = signal && ['joint_force', 'actuator', 'error'].includes(signal.group) ? `${key.split(':')[0] ?? ''} ` : '';
        label.title = `${prefix}${signal?.title ?? key}${signal?.unit ? ` [${signal.unit}]` : ''}`;
        label.title.split(/(?<=_)/).forEach((part) => label.append(part, document.createElement('wbr')));
        if (i > 0) label.style.color = colors[i % colors.length] ?? text;
      });
      const close = element('button', 'close', caption);
      close.type = 'button';
      close.textContent = '×';
      close.title = 'Close this plot';
      close.setAttribute('aria-label', `Close the plot of ${this.store.find(keys[0] ?? '')?.title ?? ''}`);
      close.addEventListener('click', () => keys.slice().forEach((key) => this.toggle(key, false)));
      const units = [...new Set(keys.map((key) => this.store.find(key)?.unit ?? ''))].map(String);
      const axis: uPlot.Axis = { stroke: text, font, grid: { stroke: edge, width: 1 }, ticks: { show: false } };
      const curve = { width: 1.4, points: { show: false }, spanGaps: false };
      const plot = new uPlot(
        {
          width: this.cellWidth(),
          height: this.cellHeight(),
          legend: { show: false },
          cursor: {
            y: false,
            points: { show: false },
            drag: { x: true, y: false, setScale: false },
            bind: { dblclick: () => () => (this.setZoom(null), null) },
          },
          scales: { x: { time: false, range: () => this.span }, ...Object.fromEntries(units.map((unit) => [`y ${unit}`, { range: (_: uPlot, low: number | null, high: number | null) => widen(low, high) }])) },
          // A second unit has its scale on the right.
          axes: [
            { ...axis, size: 16, space: 60 },
            ...units.slice(0, 2).map((unit, i) => ({
              ...axis,
              scale: `y ${unit}`,
              side: (i === 0 ? 3 : 1) as uPlot.Axis.Side,
              grid: { ...axis.grid, show: i === 0 },
              size: 46,
              space: 22,
              values: (_: uPlot, ticks: number[], __: number, ___: number, apart: number) => {
                const digits = Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(apart)))); // ticks may be 2.5 apart
                return ticks.map((v) => String(Number(v.toFixed(digits))));
              },
            })),
          ],
          hooks: { draw: [(u) => this.drawPlayhead(u, text)], setSelect: [(u) => this.zoomInto(u)] },
          series: [
            {},
            ...keys.map((key, i) => ({
              ...curve,
              scale: `y ${this.store.find(key)?.unit ?? ''}`,
              stroke: colors[i % colors.length] ?? text,
            })),
          ],
        },
        [[], ...keys.map(() => [])] as uPlot.AlignedData,
        figure,
      );
      this.acceptDrops(figure, (key) => this.overlay(at, key));
      return { keys, figure, plot };
    });
  }

  /** They share the width as long as each has enough; more of them scroll, and narrow pages have rows of two or one. */
  private cellWidth(): number {
    const width = this.root.clientWidth;
    if (width <= 340) return width - 34;
    if (width <= 620) return Math.max(130, (width - 34) / 2);
    return Math.max(170, (width - 60) / Math.max(1, this.keys.length) - 6);
  }

  private cellHeight(): number {
    return Math.max(LEAST_HEIGHT, SHARE * window.innerHeight);
  }

  resize(): void {
    for (const { plot } of this.cells) plot.setSize({ width: this.cellWidth(), height: this.cellHeight() });
  }

  /** Whether a part of the time was chosen by dragging. */
  get zoomed(): boolean {
    return this.zoom !== null;
  }

  /** All plots show this part of the time [s]; null: the last seconds. */
  setZoom(zoom: [number, number] | null): void {
    this.zoom = zoom;
    this.wholeButton.hidden = zoom === null;
    this.update();
  }

  private zoomInto(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < LEAST_DRAG) return;
    const zoom: [number, number] = [plot.posToVal(left, 'x'), plot.posToVal(left + width, 'x')];
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.setZoom(zoom);
  }

  /** The times [s] that are shown: those chosen, the last ones, or those about the playhead. */
  get span(): [number, number] {
    if (this.zoom) return this.zoom;
    const { start, end, playhead } = this.store;
    const to = playhead === null ? end : Math.min(end, Math.max(playhead + SPAN / 2, start + SPAN));
    return [Math.max(start, to - SPAN), to];
  }

  private drawPlayhead(plot: uPlot, color: string): void {
    const { playhead } = this.store;
    if (playhead === null) return;
    const { ctx, bbox } = plot;
    const x = plot.valToPos(playhead, 'x', true);
    ctx.save();
    ctx.strokeStyle = color;
    ctx.lineWidth = window.devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.restore();
  }

  draw(now: number): void {
    this.begin();
    if (!this.shown || this.paused || now - this.drawn < 100) return;
    this.drawn = now;
    this.update();
  }

  private update(): void {
    const [from, to] = this.span;
    for (const { plot, keys } of this.cells) plot.setData(this.store.columns(keys, from, to) as uPlot.AlignedData);
  }
}

/** A curve that stands still is drawn as a line in the middle, not as noise blown up. */
function widen(low: number | null, high: number | null): [number, number] {
  const a = low ?? 0;
  const b = high ?? 1;
  const least = Math.max(1e-3 * Math.max(Math.abs(a), Math.abs(b)), 1e-6);
  const missing = Math.max(0, least - (b - a)) / 2;
  const margin = 0.08 * (b - a);
  return [a - missing - margin, b + missing + margin];
}
