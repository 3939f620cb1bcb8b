import { describe, expect, it } from 'vitest';
import { inertiaBox } from '../../src/scene/anatomy_view';
import { tendonPieces, wrapCircle } from '../../src/scene/tendon_path';
import type { Rigid } from '../../src/poses/rigid';
import type { PoseNumbers, TendonInfo } from '../../src/wire/messages';

describe('inertiaBox', () => {
  it('is the box that the moments are of', () => {
    // 3 kg, half sizes 0.1, 0.2, 0.3: I = m / 3 (b² + c²).
    const moments = [0.04 + 0.09, 0.01 + 0.09, 0.01 + 0.04, 0, 0, 0];
    const { half } = inertiaBox(3, moments);
    expect([...half].sort((a, b) => a - b).map((h) => h.toFixed(9))).toEqual(['0.100000000', '0.200000000', '0.300000000']);
  });
});

describe('a thread round an obstacle', () => {
  it('lies on the circle where the straight way would go through it', () => {
    const arc = wrapCircle([-2, 0.1], [2, 0.1], 1, null);
    expect(arc.length).toBeGreaterThan(2);
    for (const p of arc) expect(Math.hypot(...p)).toBeCloseTo(1, 12);
    // Tangent at both ends.
    const [x, y] = arc[0] ?? [0, 0];
    expect((-2 - x) * x + (0.1 - y) * y).toBeCloseTo(0, 12);
    expect(wrapCircle([-2, 1.5], [2, 1.5], 1, null)).toEqual([]);
  });

  it('goes round on the side of a side point where it crosses the half line behind the centre', () => {
    const highest = (arc: [number, number][]): number => Math.max(...arc.map((p) => p[1]));
    // Through the circle, and free below it.
    for (const y of [-0.1, -1.5]) expect(highest(wrapCircle([-2, y], [2, y], 1, [0, 1]))).toBeCloseTo(1, 2);
    // Free and beside that half line: as without a side point.
    expect(wrapCircle([0.5, -2], [2.5, -1], 1, [0, 1])).toEqual([]);
    // Through the circle beside it: the shorter way.
    const beside = wrapCircle([0.3, -2], [1, 1.5], 1, [0, 1]);
    expect(beside.length).toBeGreaterThan(2);
    for (const [x] of beside) expect(x).toBeGreaterThan(0);
  });

  it('is as long as a taut thread is', () => {
    const still: Rigid = { p: [0, 0, 0], q: [0, 0, 0, 1] };
    const at = (x: number, y: number, z: number): PoseNumbers => [x, y, z, 1, 0, 0, 0];
    const tendon: TendonInfo = {
      name: 'thread',
      root: 0,
      elements: [
        { kind: 'point', body: 0, pose: at(-2, 0, 0) },
        { kind: 'sphere', body: 0, pose: at(0, 0, 0), radius: 1, side: { body: 0, at: [0, 0, 2] } },
        { kind: 'point', body: 0, pose: at(2, 0, 0) },
      ],
    };
    const pieces = tendonPieces(tendon, [still]);
    const length = pieces.reduce((sum, [a, b]) => sum + Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]), 0);
    expect(Math.abs(length - (2 * Math.sqrt(3) + Math.PI / 3))).toBeLessThan(1e-3); // the arc is drawn by chords
  });
});
