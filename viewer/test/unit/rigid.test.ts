import { describe, expect, it } from 'vitest';
import { compose, exp, rotate, type Vec3 } from '../../src/poses/rigid';

const norm = (v: number[]): number => Math.hypot(...v);

/** The exponential by its power series on 4 x 4 matrices. */
function expSeries(w: Vec3, v: Vec3): number[][] {
  const A = [
    [0, -w[2], w[1], v[0]],
    [w[2], 0, -w[0], v[1]],
    [-w[1], w[0], 0, v[2]],
    [0, 0, 0, 0],
  ];
  const at = (m: number[][], i: number, j: number): number => m[i]?.[j] ?? 0;
  let term: number[][] = [0, 1, 2, 3].map((i) => [0, 1, 2, 3].map((j) => (i === j ? 1 : 0)));
  const sum = term.map((row) => [...row]);
  for (let k = 1; k < 60; ++k) {
    term = term.map((_, i) =>
      [0, 1, 2, 3].map((j) => [0, 1, 2, 3].reduce((s, l) => s + (at(term, i, l) * at(A, l, j)) / k, 0)),
    );
    sum.forEach((row, i) => row.forEach((x, j) => (row[j] = x + at(term, i, j))));
  }
  return sum;
}

describe('exp', () => {
  for (const angle of [0, 1e-9, 1e-6, 1e-3, 0.1, 0.2999, 0.3001, 1, 3.1, Math.PI, 5])
    it(`equals its series at ${angle} rad`, () => {
      const w: Vec3 = [0.36 * angle, -0.48 * angle, 0.8 * angle];
      const v: Vec3 = [0.3, -1.1, 0.7];
      const X = exp(w, v);
      const M = expSeries(w, v);
      for (const [j, e] of ([[1, 0, 0], [0, 1, 0], [0, 0, 1]] as Vec3[]).entries())
        rotate(X.q, e).forEach((x, i) => expect(x).toBeCloseTo(M[i]?.[j] ?? NaN, 12));
      X.p.forEach((x, i) => expect(x).toBeCloseTo(M[i]?.[3] ?? NaN, 12));
      expect(norm(X.q)).toBeCloseTo(1, 14);
    });

  it('of a twist and of its negative cancel', () => {
    const X = compose(exp([0.4, 1, -2], [1, 2, 3]), exp([-0.4, -1, 2], [-1, -2, -3]));
    expect(norm(X.p)).toBeLessThan(1e-14);
    expect(Math.abs(X.q[3])).toBeCloseTo(1, 14);
  });
});
