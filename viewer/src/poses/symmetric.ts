// Eigenvalues and vectors of symmetric 3 x 3 matrices, by Jacobi rotations.
import type { Vec3 } from './rigid';

/** Of the matrix given as xx yy zz xy xz yz. vectors[i] is of unit length and belongs to values[i]; right-handed. */
export function eigenSymmetric(m: readonly number[]): { values: Vec3; vectors: [Vec3, Vec3, Vec3] } {
  const [xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0] = m;
  const a: [Vec3, Vec3, Vec3] = [
    [xx, xy, xz],
    [xy, yy, yz],
    [xz, yz, zz],
  ];
  const v: [Vec3, Vec3, Vec3] = [
    [1, 0, 0],
    [0, 1, 0],
    [0, 0, 1],
  ]; // columns are the vectors
  const pairs = [
    [0, 1],
    [0, 2],
    [1, 2],
  ] as const;
  for (let sweep = 0; sweep < 12; ++sweep)
    for (const [p, q] of pairs) {
      const off = a[p][q];
      if (Math.abs(off) <= 1e-18 * (Math.abs(a[p][p]) + Math.abs(a[q][q]))) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * off);
      const t = Math.sign(theta || 1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1);
      const s = t * c;
      for (const k of [0, 1, 2] as const) {
        const [x, y] = [a[k][p], a[k][q]];
        a[k][p] = c * x - s * y;
        a[k][q] = s * x + c * y;
      }
      for (const k of [0, 1, 2] as const) {
        const [x, y] = [a[p][k], a[q][k]];
        a[p][k] = c * x - s * y;
        a[q][k] = s * x + c * y;
        const [vx, vy] = [v[k][p], v[k][q]];
        v[k][p] = c * vx - s * vy;
        v[k][q] = s * vx + c * vy;
      }
    }
  const column = (i: 0 | 1 | 2): Vec3 => [v[0][i], v[1][i], v[2][i]];
  return { values: [a[0][0], a[1][1], a[2][2]], vectors: [column(0), column(1), column(2)] };
}
