// A strip of plots over the last seconds, and their numbers as a table.
import uPlot from 'uplot';
import 'uplot/dist/uPlot.min.css';
import { element, iconButton, setIcon } from './dom';

export interface Sample {
  time: number;
  values: number[];
}

export const CURVES = [
  { key: 'real_time_factor', title: 'real-time factor', unit: '×' },
  { key: 'step_us', title: 'step', unit: 'µs' },
  { key: 'contact_force', title: 'contact force, sum', unit: 'N' },
  { key: 'energy', title: 'energy', unit: 'J' },
  { key: 'joint_gap', title: 'joint gap', unit: 'mm' },
  { key: 'tip', title: 'tip motion', unit: 'mm' },
] as const;

const SPAN = 10; // s
const KEPT = 36_000; // samples for the table: ten minutes

export function toCsv(samples: readonly Sample[]): string {
  const head = ['time_s', ...CURVES.map((c) => `${c.key}_${c.unit}`)].join(',');
  return [head, ...samples.map((s) => [s.time, ...s.values].join(','))].join('\n') + '\n';
}

export class Plots {
  readonly root: HTMLElement;
  private samples: Sample[] = [];
  private plots: uPlot[] = [];
  private paused = false;
  private drawn = 0;
  private readonly pauseButton: HTMLButtonElement;

  constructor(
    parent: HTMLElement,
    private readonly save: (name: string, text: string) => void,
  ) {
    this.root = element('div', 'plots box', parent);
    this.root.hidden = true;
    const bar = element('div', 'bar', this.root);
    this.pauseButton = iconButton('pause', 'Hold the plots', bar, () => {
      this.paused = !this.paused;
      setIcon(this.pauseButton, this.paused ? 'play' : 'pause', this.paused ? 'Let the plots run' : 'Hold the plots');
    });
    iconButton('save', 'Save as CSV', bar, () => this.save('fork1s.csv', toCsv(this.samples)));
  }

  get shown(): boolean {
    return !this.root.hidden;
  }

  get count(): number {
    return this.samples.length;
  }

  toggle(): void {
    this.root.hidden = !this.root.hidden;
    if (this.shown && this.plots.length === 0) this.build();
    this.drawn = 0;
  }

  /** Colours are part of a plot: a change of theme builds them anew. */
  build(): void {
    for (const plot of this.plots) plot.root.parentElement?.remove();
    const style = getComputedStyle(document.documentElement);
    const text = style.getPropertyValue('--faint').trim();
    const edge = style.getPropertyValue('--edge').trim();
    const accent = style.getPropertyValue('--accent').trim();
    const font = '10px system-ui, sans-serif';
    this.plots = CURVES.map((curve) => {
      const cell = element('figure', 'plot', this.root);
      element('figcaption', '', cell).textContent = `${curve.title} [${curve.unit}]`;
      const axis: uPlot.Axis = { stroke: text, font, grid: { stroke: edge, width: 1 }, ticks: { show: false } };
      return new uPlot(
        {
          width: this.cellWidth(),
          height: 84,
          legend: { show: false },
          cursor: { show: false },
          scales: { x: { time: false }, y: { range: (_, low, high) => widen(low, high) } },
          axes: [{ ...axis, size: 16, space: 60 }, { ...axis, size: 46, space: 22, values: (_, at) => at.map((v) => String(Number(v.toPrecision(4)))) }],
          series: [{}, { stroke: accent, width: 1.4, points: { show: false } }],
        },
        [[], []],
        cell,
      );
    });
  }

  /** All curves share the width; narrow pages scroll. */
  private cellWidth(): number {
    return Math.max(150, (this.root.clientWidth - 60) / CURVES.length - 6);
  }

  resize(): void {
    for (const plot of this.plots) plot.setSize({ width: this.cellWidth(), height: 84 });
  }

  add(sample: Sample): void {
    const last = this.samples.at(-1);
    if (last && sample.time < last.time) this.samples = []; // reset or another recording
    if (last && sample.time === last.time) return;
    this.samples.push(sample);
    if (this.samples.length > KEPT) this.samples.splice(0, KEPT / 10);
  }

  draw(now: number): void {
    if (!this.shown || this.paused || now - this.drawn < 100) return;
    this.drawn = now;
    const end = this.samples.at(-1)?.time ?? 0;
    let first = this.samples.length;
    while (first > 0 && (this.samples[first - 1]?.time ?? 0) > end - SPAN) --first;
    const part = this.samples.slice(first);
    const times = part.map((s) => s.time);
    this.plots.forEach((plot, i) => plot.setData([times, part.map((s) => s.values[i] ?? null)]));
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
