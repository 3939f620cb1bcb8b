// Every signal of the simulation over time: what each is, and its values frame by frame.
import type { Frame, SceneMessage } from '../wire/messages';

export interface Signal {
  key: string; // in tables and plots
  title: string;
  group: string;
  unit: string;
  body: number; // that it speaks of, -1
}

export const GROUPS: Record<string, string> = {
  run: 'Run',
  energy: 'Energy',
  accuracy: 'Accuracy',
  contact: 'Contact force by pair',
  position: 'Joint positions, from the reference',
  joint_force: 'Joint forces: springs, dampers, servos',
  actuator: 'Actuator forces',
  error: 'Estimated error by body',
};

/** Of a frame's scalars: unit, what to multiply by, group, title. */
const SCALARS: Record<string, [unit: string, scale: number, group: string, title: string]> = {
  real_time_factor: ['×', 1, 'run', 'real-time factor'],
  step_us: ['µs', 1, 'run', 'step'],
  reduce_ms: ['ms', 1, 'run', 'last reduction'],
  kinetic_energy: ['J', 1, 'energy', 'kinetic energy'],
  potential_energy: ['J', 1, 'energy', 'potential energy'],
  joint_gap: ['mm', 1000, 'accuracy', 'joint gap'],
  penetration: ['mm', 1000, 'accuracy', 'penetration'],
  residual: ['', 1, 'accuracy', 'contact residual'],
  error: ['mm', 1000, 'accuracy', 'estimated error'],
  load_factor: ['', 1, 'contact', 'grasp load factor'],
};

export interface Row {
  time: number; // s
  values: Float64Array; // in the order of the signals known then; NaN: not told
}

const MOST_ROWS = 36_000; // ten minutes
const MOST_NUMBERS = 4_000_000;

export class SignalStore {
  readonly signals: Signal[] = [];
  private readonly places = new Map<string, number>();
  private rows: Row[] = [];
  private told: { scene: SceneMessage; places: Int32Array } | null = null;
  /** Called when another signal is known. */
  onNew: () => void = () => undefined;

  private place(signal: Signal): number {
    const known = this.places.get(signal.key);
    if (known !== undefined) return known;
    this.places.set(signal.key, this.signals.length);
    this.signals.push(signal);
    this.onNew();
    return this.signals.length - 1;
  }

  find(key: string): Signal | undefined {
    return this.signals[this.places.get(key) ?? -1];
  }

  private useScene(scene: SceneMessage): Int32Array {
    if (this.told?.scene === scene) return this.told.places;
    for (const name of scene.scalars) {
      const known = SCALARS[name];
      if (known) this.place({ key: name, title: known[3], group: known[2], unit: known[0], body: -1 });
    }
    this.place({ key: 'energy', title: 'energy', group: 'energy', unit: 'J', body: -1 });
    this.place({ key: 'contact_force', title: 'contact force, sum', group: 'contact', unit: 'N', body: -1 });
    this.place({ key: 'tip', title: 'tip motion', group: 'run', unit: 'mm', body: -1 });
    const prefix: Record<string, string> = { position: 'q', joint_force: 'tau', actuator: 'f', error: 'error' };
    const places = Int32Array.from(scene.signals, (s) =>
      this.place({ key: `${prefix[s.group] ?? s.group}:${s.name}`, title: s.name, group: s.group, unit: s.unit, body: s.body }),
    );
    this.told = { scene, places };
    return places;
  }

  /** `tip`: motion of the first interface body [m]. */
  add(scene: SceneMessage, frame: Frame, tip: number): void {
    const scalar = (name: string): number => frame.scalars[scene.scalars.indexOf(name)] ?? NaN;
    const time = scalar('time');
    const last = this.rows.at(-1);
    if (last && time === last.time) return;
    if (last && time < last.time) this.forgetFrom(time); // a reset, a moment gone back to, another recording
    const told = this.useScene(scene);
    const pairs = new Map<string, [number, number, number]>();
    const name = (body: number): string => scene.bodies[body]?.name ?? 'world';
    let sum = 0;
    for (const c of frame.contacts) {
      const [a, b, s] = c.a <= c.b ? [c.a, c.b, 1] : [c.b, c.a, -1];
      const key = `contact:${name(a)}/${name(b)}`;
      this.place({ key, title: `${name(a)} on ${name(b)}`, group: 'contact', unit: 'N', body: b });
      const total = pairs.get(key) ?? [0, 0, 0];
      pairs.set(key, [total[0] + s * c.force[0], total[1] + s * c.force[1], total[2] + s * c.force[2]]);
      sum += Math.hypot(...c.force);
    }
    const values = new Float64Array(this.signals.length).fill(NaN);
    const put = (key: string, value: number): void => {
      values[this.places.get(key) ?? -1] = value;
    };
    scene.scalars.forEach((key, i) => SCALARS[key] && put(key, (frame.scalars[i] ?? NaN) * SCALARS[key][1]));
    put('energy', scalar('kinetic_energy') + scalar('potential_energy'));
    put('contact_force', sum);
    put('tip', 1000 * tip);
    // A pair that does not touch presses with nothing.
    this.signals.forEach((s, i) => {
      if (s.key.startsWith('contact:')) values[i] = Math.hypot(...(pairs.get(s.key) ?? [0]));
    });
    frame.signals.forEach((value, i) => (values[told[i] ?? -1] = value));
    this.rows.push({ time, values });
    const most = Math.min(MOST_ROWS, MOST_NUMBERS / values.length);
    if (this.rows.length > most) this.rows.splice(0, Math.ceil(most / 10));
  }

  private forgetFrom(time: number): void {
    let kept = this.rows.length;
    while (kept > 0 && (this.rows[kept - 1]?.time ?? 0) >= time) --kept;
    this.rows.length = kept;
  }

  get length(): number {
    return this.rows.length;
  }

  /** Newest value; NaN: none. */
  now(key: string): number {
    return this.rows.at(-1)?.values[this.places.get(key) ?? -1] ?? NaN;
  }

  /** Times and values of the last seconds, a column for each key. */
  last(seconds: number, keys: readonly string[]): [number[], ...(number | null)[][]] {
    const end = this.rows.at(-1)?.time ?? 0;
    let first = this.rows.length;
    while (first > 0 && (this.rows[first - 1]?.time ?? 0) > end - seconds) --first;
    const part = this.rows.slice(first);
    const columns = keys.map((key) => {
      const place = this.places.get(key) ?? -1;
      return part.map((row) => {
        const value = row.values[place] ?? NaN;
        return Number.isFinite(value) ? value : null;
      });
    });
    return [part.map((row) => row.time), ...columns];
  }

  /** Numbers with a point whatever the language of the machine; nothing where nothing was told. */
  csv(): string {
    const quote = (text: string): string => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const head = ['time_s', ...this.signals.map((s) => quote(s.unit ? `${s.key}_${s.unit}` : s.key))];
    const number = (x: number | undefined): string => (x !== undefined && Number.isFinite(x) ? String(x) : '');
    const lines = this.rows.map((row) => [row.time, ...this.signals.map((_, i) => row.values[i])].map(number).join(','));
    return [head.join(','), ...lines].join('\n') + '\n';
  }
}
