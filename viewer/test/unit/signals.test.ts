import { describe, expect, it } from 'vitest';
import { RollingPast } from '../../src/replay/past';
import { SignalStore } from '../../src/signals/store';
import { formatDecimal, parseDecimal } from '../../src/ui/decimal';
import type { Rigid } from '../../src/poses/rigid';
import type { Frame, GhostFrame, SceneMessage } from '../../src/wire/messages';
import { haveStreams, readStream } from '../streams';

describe('numbers as people type them', () => {
  it('take a point or a comma', () => {
    expect(parseDecimal('0,25')).toBe(0.25);
    expect(parseDecimal(' -1.5e-3 ')).toBe(-0.0015);
    for (const text of ['', 'x', '1,2,3', '1.000,5', '0x10', 'Infinity']) expect(parseDecimal(text)).toBeNaN();
    expect(formatDecimal(0.1 + 0.2)).toBe('0.3');
    expect(formatDecimal(null)).toBe('');
  });
});

const scene = {
  scalars: ['time', 'kinetic_energy', 'potential_energy'],
  signals: [{ name: 'elbow, left', group: 'position', unit: 'rad', body: 0 }],
  roots: [{ base: 'fixed' }, { base: 'free' }],
  bodies: [
    { name: 'tip', root: 0, interface: true },
    { name: 'ball', root: 1 },
  ],
} as unknown as SceneMessage;
const frame = (time: number, force: number): Frame =>
  ({
    scalars: Float64Array.of(time, 1, 2),
    signals: Float32Array.of(0.5),
    contacts: force === 0 ? [] : [1, -1].map((s) => ({ a: s > 0 ? 0 : 1, b: s > 0 ? 1 : 0, normal: [0, 0, s], friction: 0.5, force: [0.25 * force, 0, s * force] })),
  }) as unknown as Frame;

describe('SignalStore', () => {
  it('sums the contacts of a pair, whichever way round they are told', () => {
    const store = new SignalStore();
    store.add(scene, frame(0, 3));
    expect(store.now('contact:tip/ball')).toBe(6);
    expect(store.now('contact_force')).toBeCloseTo(6.185, 3);
    expect(store.now('friction_use')).toBeCloseTo(50);
    expect(store.now('energy')).toBe(3);
    expect(store.now('q:elbow, left')).toBe(0.5);
    store.add(scene, frame(0.1, 0));
    expect(store.now('contact:tip/ball')).toBe(0);
    expect(store.now('friction_use')).toBe(0);
  });

  it('writes a table that machines read, with a column for what came later', () => {
    const store = new SignalStore();
    store.add(scene, frame(0, 0));
    store.add(scene, frame(0.5, 2));
    const [head = '', first = '', second = ''] = store.csv().trim().split('\n');
    expect(head).toContain('"q:elbow, left_rad"');
    expect(head.endsWith('contact:tip/ball_N')).toBe(true);
    expect(first.endsWith(',')).toBe(true); // not told then
    expect(second.endsWith(',4')).toBe(true);
    expect(second.startsWith('0.5,')).toBe(true);
  });

  it('has places by both recovery modes, and by the full simulation once it comes up', () => {
    const store = new SignalStore();
    const at = (x: number): Rigid[] => [0, 1].map((b) => ({ p: [x, b, 2], q: [0, 0, 0, 1] }));
    const ghost = (time: number, x: number): GhostFrame => ({ time, poses: Float32Array.from([x, 0, 2, 1, 0, 0, 0, x, 1, 2, 1, 0, 0, 0]) }) as GhostFrame;
    store.add(scene, frame(0, 0), { own: at(0.001), other: at(0.002) });
    store.add(scene, frame(0.1, 0), { own: at(0.003), other: null });
    store.addFull(scene, ghost(0, 0.5));
    store.addFull(scene, ghost(0.05, 0.7)); // no frame is of that time
    const keys = store.together('at:ball.x');
    expect(keys.map((key) => store.find(key)?.title)).toEqual(['ball x', 'twist', 'full']);
    expect(store.columns(keys)).toEqual([[0, 0.1], [1, 3], [2, null], [500, null]]);
    expect(store.columns(store.together('at:tip.z')).slice(1)).toEqual([[2000, 2000], [2000, null], [2000, null]]);
  });

  it('forgets what no longer happened where time goes back', () => {
    const store = new SignalStore();
    for (const t of [0, 1, 2, 3]) store.add(scene, frame(t, 0));
    store.add(scene, frame(1.5, 0));
    expect(store.columns(['energy'])[0]).toEqual([0, 1, 1.5]);
  });
});

describe.skipIf(!haveStreams())('RollingPast', () => {
  it('is a recording that plays whatever was dropped, and a pause adds nothing to it', () => {
    const { messages } = readStream('hand_exact');
    const past = new RollingPast();
    for (const message of messages) past.take(message);
    const length = past.length;
    const last = messages.at(-1);
    for (let i = 0; i < 10; ++i) if (last) past.take(last);
    expect(past.length).toBe(length);
    expect(past.recording().length).toBeGreaterThan(length);
  });
});
