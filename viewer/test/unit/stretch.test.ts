import { describe, expect, it } from 'vitest';
import { eigenSymmetric } from '../../src/poses/symmetric';
import { stretched } from '../../src/ui/stretch';

describe('an ellipsoid of compliance that is dragged', () => {
  const C = [4, 2, 1, 0.5, -0.3, 0.2];

  it('along a principal axis: that axis alone grows', () => {
    const { values, vectors } = eigenSymmetric(C);
    const pulled = eigenSymmetric(stretched(C, vectors[1], 3));
    const wished = [values[0], 3 * values[1], values[2]].sort((a, b) => a - b);
    pulled.values.sort((a, b) => a - b).forEach((value, i) => expect(value).toBeCloseTo(wished[i] ?? NaN, 9));
  });

  it('any way: it stays symmetric and positive, and back again it is what it was', () => {
    const u: [number, number, number] = [0.6, 0, 0.8];
    const there = stretched(C, u, 2.5);
    expect(Math.min(...eigenSymmetric(there).values)).toBeGreaterThan(0);
    stretched(there, u, 1 / 2.5).forEach((value, i) => expect(value).toBeCloseTo(C[i] ?? NaN, 9));
  });
});
