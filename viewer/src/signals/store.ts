// Every signal of the simulation over time: what each is, and its values frame by frame.
import type { Rigid } from '../poses/rigid';
import { frictionUse } from '../scene/colouring';
import type { Frame, GhostFrame, SceneMessage } from '../wire/messages';

export interface Signal {
  key: string; // in tables and plots
  title: string;
  group: string;
  unit: string;
  body: number; // that it speaks of, -1
  beside?: string; // key of the signal that it is drawn with: the same by another method
}

/** Where bodies are, by the recovery mode that the simulation takes and by the other one. */
export interface Places {
  own: readonly Rigid[];
  other: readonly Rigid[] | null;
}

/** In the order of the list: what moves and what bears first, the solver's own last. */
export const GROUPS: Record<string, string> = {
  position: 'Joint positions, from the reference',
  contact: 'Contact: forces and use of friction',
  base: 'Heights of bases',
  joint_force: 'Joint forces: springs, dampers, servos',
  actuator: 'Actuator forces',
  place: 'Places of bodies: exact, twist, full simulation',
  energy: 'Energy',
  error: 'Estimated error by body',
  accuracy: 'Accuracy',
  run: 'Run',
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
const MOST_PLACES = 100; // bodies
const AXES = ['x', 'y', 'z'];
const SAME_TIME = 1e-6; // s

export class SignalStore {
  readonly signals: Signal[] = [];
  private readonly places = new Map<string, number>();
  private rows: Row[] = [];
  private told: { scene: SceneMessage; places: Int32Array } | null = null;
  private placed: { body: number; first: number }[] = []; // own, other, full of x, then of y, then of z
  private bases: { root: number; at: number }[] = []; // that move
  /** The time [s] that is looked at; null: the newest. */
  playhead: number | null = null;
  /** A recording from disk: signals without a value in it are left out. */
  onlyKnown = false;
  private readonly known = new Set<string>();
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
    this.place({ key: 'friction_use', title: 'friction in use, largest', group: 'contact', unit: '%', body: -1 });
    this.bases = scene.roots.flatMap(({ base, name, first_body }, root) =>
      base === 'floating' || base === 'driven'
        ? [{ root, at: this.place({ key: `base:${name}`, title: `${name} height`, group: 'base', unit: 'mm', body: first_body }) }]
        : [],
    );
    const prefix: Record<string, string> = { position: 'q', joint_force: 'tau', actuator: 'f', error: 'error' };
    const places = Int32Array.from(scene.signals, (s) =>
      this.place({ key: `${prefix[s.group] ?? s.group}:${s.name}`, title: s.name, group: s.group, unit: s.unit, body: s.body }),
    );
    this.placed = [];
    const other = scene.recovery === 'twist' ? 'exact' : 'twist';
    scene.bodies.forEach((body, b) => {
      if (!(body.interface || scene.roots[body.root]?.base === 'free') || this.placed.length >= MOST_PLACES) return;
      const own = AXES.map((axis) => this.placeOf(body.name, axis, b, other));
      this.placed.push({ body: b, first: own[0] ?? -1 });
    });
    this.told = { scene, places };
    return places;
  }

  /** One coordinate by all methods; known once, they stand side by side. */
  private placeOf(name: string, axis: string, body: number, other: string): number {
    const key = `at:${name}.${axis}`;
    const first = this.place({ key, title: `${name} ${axis}`, group: 'place', unit: 'mm', body });
    this.place({ key: `${key} other`, title: other, group: 'place', unit: 'mm', body, beside: key });
    this.place({ key: `${key} full`, title: 'full', group: 'place', unit: 'mm', body, beside: key });
    const second = this.signals[first + 1];
    if (second) second.title = other; // it changes with the recovery mode
    return first;
  }

  /** Whether the signal can be shown. */
  has(key: string): boolean {
    return this.onlyKnown ? this.known.has(key) : this.places.has(key);
  }

  /** The signal and what is drawn with it. */
  together(key: string): string[] {
    return [key, ...this.signals.filter((s) => s.beside === key && this.has(s.key)).map((s) => s.key)];
  }

  /** Where the full simulation has bodies at a time that has been told; it comes behind. */
  addFull(scene: SceneMessage, ghost: GhostFrame): void {
    if (this.told?.scene !== scene) return;
    for (let i = this.rows.length; i-- > 0; ) {
      const row = this.rows[i];
      if (!row || row.time < ghost.time - SAME_TIME) return;
      if (row.time > ghost.time + SAME_TIME) continue;
      for (const { body, first } of this.placed)
        for (let k = 0; k < 3; ++k) row.values[first + 3 * k + 2] = 1000 * (ghost.poses[7 * body + k] ?? NaN);
    }
  }

  /** `places`: where bodies are, if that is looked at. */
  add(scene: SceneMessage, frame: Frame, places: Places | null = null): void {
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
    put('friction_use', 100 * Math.max(0, ...frame.contacts.map(frictionUse)));
    for (const { root, at } of this.bases) values[at] = 1000 * (frame.roots[root]?.pose[2] ?? NaN);
    for (const { body, first } of this.placed)
      for (let k = 0; k < 3; ++k) {
        values[first + 3 * k] = 1000 * (places?.own[body]?.p[k] ?? NaN);
        values[first + 3 * k + 1] = 1000 * (places?.other?.[body]?.p[k] ?? NaN);
      }
    // A pair that does not touch presses with nothing.
    this.signals.forEach((s, i) => {
      if (s.key.startsWith('contact:')) values[i] = Math.hypot(...(pairs.get(s.key) ?? [0]));
    });
    frame.signals.forEach((value, i) => (values[told[i] ?? -1] = value));
    this.rows.push({ time, values });
    if (this.onlyKnown) this.findKnown(values);
    const most = Math.min(MOST_ROWS, MOST_NUMBERS / values.length);
    if (this.rows.length > most) this.rows.splice(0, Math.ceil(most / 10));
  }

  private findKnown(values: Float64Array): void {
    this.signals.forEach(({ key }, i) => {
      if (!Number.isFinite(values[i]) || this.known.has(key)) return;
      this.known.add(key);
      this.onNew();
    });
  }

  private forgetFrom(time: number): void {
    let kept = this.rows.length;
    while (kept > 0 && (this.rows[kept - 1]?.time ?? 0) >= time) --kept;
    this.rows.length = kept;
  }

  get length(): number {
    return this.rows.length;
  }

  get start(): number {
    return this.rows[0]?.time ?? 0;
  }
  get end(): number {
    return this.rows.at(-1)?.time ?? 0;
  }

  /** Value at the playhead; NaN: none. */
  now(key: string): number {
    const at = this.playhead === null ? this.rows.length : this.countUntil(this.playhead);
    return this.rows[at - 1]?.values[this.places.get(key) ?? -1] ?? NaN;
  }

  /** How many rows are of `time` or before. */
  private countUntil(time: number): number {
    let low = 0;
    for (let high = this.rows.length; low < high; ) {
      const middle = (low + high) >> 1;
      if ((this.rows[middle]?.time ?? Infinity) <= time + SAME_TIME) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Times and values between `from` and `to` [s], a column for each key. */
  columns(keys: readonly string[], from = -Infinity, to = Infinity): [number[], ...(number | null)[][]] {
    const part = this.rows.slice(this.countUntil(from - 2 * SAME_TIME), this.countUntil(to));
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
