// Rigid transforms in double precision: position and unit quaternion (x y z w).

export type Vec3 = [number, number, number];
export type Quat = [number, number, number, number];

export interface Rigid {
  p: Vec3;
  q: Quat;
}

export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export function rotate(q: Quat, v: Vec3): Vec3 {
  const u: Vec3 = [q[0], q[1], q[2]];
  const t = cross(u, v);
  const s = cross(u, t);
  return [
    v[0] + 2 * (q[3] * t[0] + s[0]),
    v[1] + 2 * (q[3] * t[1] + s[1]),
    v[2] + 2 * (q[3] * t[2] + s[2]),
  ];
}

export function compose(a: Rigid, b: Rigid): Rigid {
  const r = rotate(a.q, b.p);
  const [ax, ay, az, aw] = a.q;
  const [bx, by, bz, bw] = b.q;
  return {
    p: [a.p[0] + r[0], a.p[1] + r[1], a.p[2] + r[2]],
    q: [
      aw * bx + ax * bw + ay * bz - az * by,
      aw * by - ax * bz + ay * bw + az * bx,
      aw * bz + ax * by - ay * bx + az * bw,
      aw * bw - ax * bx - ay * by - az * bz,
    ],
  };
}

export function apply(X: Rigid, v: Vec3): Vec3 {
  const r = rotate(X.q, v);
  return [X.p[0] + r[0], X.p[1] + r[1], X.p[2] + r[2]];
}

/** From x y z qw qx qy qz, as the wire has poses. */
export function fromNumbers(n: ArrayLike<number>, at = 0): Rigid {
  const g = (i: number): number => n[at + i] ?? 0;
  return { p: [g(0), g(1), g(2)], q: [g(4), g(5), g(6), g(3)] };
}

/** Exp of the twist [w; v]: rotation by |w| about w, position v + b w x v + c w x (w x v). */
export function exp(w: Vec3, v: Vec3): Rigid {
  const t2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
  const t = Math.sqrt(t2);
  let s: number, b: number, c: number;
  if (t < 0.3) {
    s = 0.5 * (1 - (t2 / 24) * (1 - (t2 / 80) * (1 - (t2 / 168) * (1 - t2 / 288))));
    b = 0.5 * (1 - (t2 / 12) * (1 - (t2 / 30) * (1 - (t2 / 56) * (1 - (t2 / 90) * (1 - t2 / 132)))));
    c = (1 - (t2 / 20) * (1 - (t2 / 42) * (1 - (t2 / 72) * (1 - (t2 / 110) * (1 - t2 / 156))))) / 6;
  } else {
    const h = Math.sin(0.5 * t);
    s = h / t;
    b = (2 * h * h) / t2;
    c = (t - Math.sin(t)) / (t2 * t);
  }
  const wv = cross(w, v);
  const wwv = cross(w, wv);
  return {
    p: [v[0] + b * wv[0] + c * wwv[0], v[1] + b * wv[1] + c * wwv[1], v[2] + b * wv[2] + c * wwv[2]],
    q: [s * w[0], s * w[1], s * w[2], Math.cos(0.5 * t)],
  };
}

export function inverse(X: Rigid): Rigid {
  const q: Quat = [-X.q[0], -X.q[1], -X.q[2], X.q[3]];
  const [x, y, z] = rotate(q, X.p);
  return { p: [-x, -y, -z], q };
}
