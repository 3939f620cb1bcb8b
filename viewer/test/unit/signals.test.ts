import { describe, expect, it } from 'vitest';
import { RollingPast } from '../../src/replay/past';
import { SignalStore } from '../../src/signals/store';
import { formatDecimal, parseDecimal } from '../../src/ui/decimal';
import type { Frame, SceneMessage } from '../../src/wire/messages';
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
  bodies: [{ name: 'tip' }, { name: 'ball' }],
} as unknown as SceneMessage;
const frame = (time: number, force: number): Frame =>
  ({
    scalars: Float64Array.of(time, 1, 2),
    signals: Float32Array.of(0.5),
    contacts: force === 0 ? [] : [1, -1].map((s) => ({ a: s > 0 ? 0 : 1, b: s > 0 ? 1 : 0, force: [0, 0, s * force] })),
  }) as unknown as Frame;

describe('SignalStore', () => {
  it('sums the contacts of a pair, whichever way round they are told', () => {
    const store = new SignalStore();
    store.add(scene, frame(0, 3), 0);
    expect(store.now('contact:tip/ball')).toBe(6);
    expect(store.now('contact_force')).toBe(6);
    expect(store.now('energy')).toBe(3);
    expect(store.now('q:elbow, left')).toBe(0.5);
    store.add(scene, frame(0.1, 0), 0);
    expect(store.now('contact:tip/ball')).toBe(0);
  });

  it('writes a table that machines read, with a column for what came later', () => {
    const store = new SignalStore();
    store.add(scene, frame(0, 0), 0.001);
    store.add(scene, frame(0.5, 2), 0.002);
    const [head = '', first = '', second = ''] = store.csv().trim().split('\n');
    expect(head).toContain('"q:elbow, left_rad"');
    expect(head.endsWith('contact:tip/ball_N')).toBe(true);
    expect(first.endsWith(',')).toBe(true); // not told then
    expect(second.endsWith(',4')).toBe(true);
    expect(second.startsWith('0.5,')).toBe(true);
  });

  it('forgets what no longer happened where time goes back', () => {
    const store = new SignalStore();
    for (const t of [0, 1, 2, 3]) store.add(scene, frame(t, 0), 0);
    store.add(scene, frame(1.5, 0), 0);
    expect(store.last(10, ['energy'])[0]).toEqual([0, 1, 1.5]);
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
