// The way of a taut thread from point to point, round spheres and cylinders: src/mechanism/wrap.cpp, for drawing.
import { apply, compose, cross, type Rigid, rotate, type Vec3 } from '../poses/rigid';
import type { TendonInfo } from '../wire/messages';

type Flat = [number, number];

const ARC_POINTS = 8;
const NOTHING = 1e-15;

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const length = (a: Vec3): number => Math.hypot(...a);
const scaled = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
const flatCross = (a: Flat, b: Flat): number => a[0] * b[1] - a[1] * b[0];
const minus = (a: Flat, b: Flat): Flat => [a[0] - b[0], a[1] - b[1]];
const flatDot = (a: Flat, b: Flat): number => a[0] * b[0] + a[1] * b[1];

function meet(a: Flat, b: Flat, c: Flat, d: Flat): boolean {
  const u = minus(b, a);
  const v = minus(d, c);
  const w = minus(c, a);
  const det = flatCross(u, v);
  if (Math.abs(det) < NOTHING) return false;
  const s = flatCross(w, v) / det;
  const t = flatCross(w, u) / det;
  return s >= 0 && s <= 1 && t >= 0 && t <= 1;
}

/** Where the tangent from p touches the circle. */
function touch(p: Flat, radius: number, turn: number): Flat {
  const l2 = flatDot(p, p);
  const out = Math.sqrt(l2 - radius * radius);
  const s = radius / l2;
  return [s * (radius * p[0] - turn * out * p[1]), s * (radius * p[1] + turn * out * p[0])];
}

interface Way {
  first: Flat;
  last: Flat;
  turn: number;
  angle: number;
}

function wayRound(a: Flat, b: Flat, radius: number, turn: number): Way {
  const first = touch(a, radius, turn);
  const last = touch(b, radius, -turn);
  const angle = turn * Math.atan2(flatCross(first, last), flatDot(first, last));
  return { first, last, turn, angle: angle < 0 ? angle + 2 * Math.PI : angle };
}

function arcOf(way: Way): Flat[] {
  return Array.from({ length: ARC_POINTS + 1 }, (_, i): Flat => {
    const t = (way.turn * way.angle * i) / ARC_POINTS;
    const c = Math.cos(t);
    const s = Math.sin(t);
    return [c * way.first[0] - s * way.first[1], s * way.first[0] + c * way.first[1]];
  });
}

/** Whether a-b passes the centre on the side away from `side`: across the half line opposite to it. */
function passesBehind(a: Flat, b: Flat, side: Flat): boolean {
  const atA = flatCross(side, a);
  const atB = flatCross(side, b);
  if (atA < 0 === atB < 0) return false;
  const share = atA / (atA - atB);
  return flatDot([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])], side) < 0;
}

/** The arc a thread from a to b lies on, as points on the circle from first to last; empty: it does not touch. */
export function wrapCircle(a: Flat, b: Flat, radius: number, side: Flat | null): Flat[] {
  if (Math.hypot(...a) < radius || Math.hypot(...b) < radius || radius < NOTHING) return [];
  const way = minus(b, a);
  if (flatDot(way, way) < NOTHING) return [];
  if (side && passesBehind(a, b, side)) return arcOf(wayRound(a, b, radius, flatCross(a, b) > 0 ? -1 : 1));
  const share = Math.min(1, Math.max(0, -flatDot(way, a) / flatDot(way, way)));
  if (Math.hypot(a[0] + share * way[0], a[1] + share * way[1]) > radius) return [];
  const apart = (w: Way): number => Math.hypot(...minus(w.first, w.last));
  const ways = [wayRound(a, b, radius, -1), wayRound(a, b, radius, 1)]
    .filter((w) => !meet(a, w.first, b, w.last))
    .sort((v, w) => apart(v) - apart(w));
  return ways[0] ? arcOf(ways[0]) : [];
}

/** In the obstacle's axes about its centre. */
function onObstacle(kind: string, radius: number, a: Vec3, b: Vec3, side: Vec3 | null): Vec3[] {
  if (length(a) < NOTHING || length(b) < NOTHING) return [];
  const ring = side !== null && length(side) < radius; // the thread goes through a hole
  let x: Vec3 = [1, 0, 0];
  let y: Vec3 = [0, 1, 0];
  if (kind === 'sphere') {
    x = scaled(a, 1 / length(a));
    let normal = cross(a, b);
    if (length(normal) < NOTHING) normal = cross(x, Math.abs(x[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
    y = cross(normal, x);
    y = scaled(y, 1 / length(y));
  }
  const flat = (p: Vec3): Flat => [dot(p, x), dot(p, y)];
  const points = ((): Flat[] => {
    if (ring) {
      const middle: Flat = [flat(a)[0] + flat(b)[0], flat(a)[1] + flat(b)[1]];
      const size = Math.hypot(...middle);
      return size > 0 ? [[(radius * middle[0]) / size, (radius * middle[1]) / size]] : [];
    }
    if (!side) return wrapCircle(flat(a), flat(b), radius, null);
    const seen = flat(side);
    const size = Math.hypot(...seen);
    const rim: Flat = size < NOTHING ? [radius, 0] : [(radius * seen[0]) / size, (radius * seen[1]) / size];
    return wrapCircle(flat(a), flat(b), radius, rim);
  })();
  // A cylinder's thread climbs at a constant rate.
  const first = points[0];
  const last = points.at(-1);
  if (!first || !last) return [];
  const to = Math.hypot(...minus(first, flat(a)));
  const from = Math.hypot(...minus(flat(b), last));
  const along = points.slice(1).reduce((sum, p, i) => sum + Math.hypot(...minus(p, points[i] ?? p)), 0);
  const climbs = kind === 'cylinder' ? (b[2] - a[2]) / (to + along + from || 1) : 0;
  return points.map(([u, v], i): Vec3 => {
    const at: Vec3 = [u * x[0] + v * y[0], u * x[1] + v * y[1], u * x[2] + v * y[2]];
    if (kind === 'cylinder') at[2] = a[2] + climbs * (to + (along * i) / Math.max(1, points.length - 1));
    return at;
  });
}

/** Straight pieces of a tendon in the world, two points each. */
export function tendonPieces(tendon: TendonInfo, poses: readonly Rigid[]): [Vec3, Vec3][] {
  const pieces: [Vec3, Vec3][] = [];
  const pose = (e: TendonInfo['elements'][number]): Rigid | null => {
    const X = poses[e.body ?? -1];
    const [px = 0, py = 0, pz = 0, qw = 1, qx = 0, qy = 0, qz = 0] = e.pose ?? [];
    return X ? compose(X, { p: [px, py, pz], q: [qx, qy, qz, qw] }) : null;
  };
  let before: Vec3 | null = null;
  tendon.elements.forEach((element, i) => {
    const X = pose(element);
    if (element.kind === 'pulley' || !X) {
      before = null; // a further branch begins
      return;
    }
    if (element.kind === 'point') {
      if (before) pieces.push([before, X.p]);
      before = X.p;
      return;
    }
    const next = tendon.elements[i + 1];
    const end = next ? pose(next) : null;
    if (!before || !end) return;
    const inverse: Rigid['q'] = [-X.q[0], -X.q[1], -X.q[2], X.q[3]];
    const local = (p: Vec3): Vec3 => rotate(inverse, [p[0] - X.p[0], p[1] - X.p[1], p[2] - X.p[2]]);
    const holder = poses[element.side?.body ?? -1];
    const side = holder && element.side ? local(apply(holder, element.side.at)) : null;
    for (const point of onObstacle(element.kind, element.radius ?? 0, local(before), local(end.p), side)) {
      const at: Vec3 = apply(X, point);
      pieces.push([before, at]);
      before = at;
    }
  });
  return pieces;
}
