import { describe, expect, it } from 'vitest';
import { eigenSymmetric } from '../../src/poses/symmetric';

describe('eigenSymmetric', () => {
  for (const m of [
    [1, 2, 3, 0, 0, 0],
    [2, 2, 2, 1, 1, 1],
    [4e-3, 1e-6, 2e-3, 1e-4, -5e-4, 3e-5],
    [0, 0, 0, 0, 0, 0],
    [1, 1, 0, 1, 0, 0],
  ])
    it(`puts ${m.join(' ')} together again`, () => {
      const { values, vectors } = eigenSymmetric(m);
      const entry = (i: number, j: number): number =>
        [0, 1, 2].reduce((s, k) => s + (values[k] ?? 0) * (vectors[k]?.[i] ?? 0) * (vectors[k]?.[j] ?? 0), 0);
      const places: [number, number][] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];
      places.forEach(([i, j], k) => expect(entry(i, j)).toBeCloseTo(m[k] ?? NaN, 14));
    });
});
