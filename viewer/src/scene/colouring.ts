// What a body's colour tells: its role, the gap at its joint, or just what the file says.
import * as THREE from 'three';
import { apply, fromNumbers, type Rigid } from '../poses/rigid';
import type { Contact, SceneMessage } from '../wire/messages';
import { COLORS } from './theme';

export type Colouring = 'file' | 'tips' | 'roles' | 'gaps' | 'error' | 'friction';

/** Colours of these follow from the frame. */
export const isMeasured = (colouring: Colouring): boolean => ['gaps', 'error', 'friction'].includes(colouring);

/** Distance [m] at every body between its joint's anchor seen from the body and seen from its parent. */
export function jointGaps(scene: SceneMessage, poses: Rigid[]): Float64Array {
  const gaps = new Float64Array(scene.bodies.length);
  scene.joints.forEach((joint) => {
    const body = scene.bodies[joint.body];
    const parent = scene.bodies[body?.parent ?? -1];
    const X = poses[joint.body];
    const Y = poses[body?.parent ?? -1];
    const screw = scene.screws[joint.offset];
    if (!body || !parent || !X || !Y || !screw || joint.size !== 1) return;
    const [wx = 0, wy = 0, wz = 0, vx = 0, vy = 0, vz = 0] = screw;
    if (wx * wx + wy * wy + wz * wz < 0.5) return; // a slide opens along its axis by right
    // The point of the axis nearest the root: w x v.
    const anchor: [number, number, number] = [wy * vz - wz * vy, wz * vx - wx * vz, wx * vy - wy * vx];
    const local = (info: typeof body): [number, number, number] => {
      const R = fromNumbers(info.pose);
      const inverse: Rigid = { p: [0, 0, 0], q: [-R.q[0], -R.q[1], -R.q[2], R.q[3]] };
      return apply(inverse, [anchor[0] - R.p[0], anchor[1] - R.p[1], anchor[2] - R.p[2]]);
    };
    const a = apply(X, local(body));
    const b = apply(Y, local(parent));
    const gap = Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    gaps[joint.body] = Math.max(gaps[joint.body] ?? 0, gap);
  });
  return gaps;
}

/** Estimated error [m] of every body that has one, 0 for the others. */
export function bodyErrors(scene: SceneMessage, signals: Float32Array): Float64Array {
  const errors = new Float64Array(scene.bodies.length);
  if (signals.length === scene.signals.length)
    scene.signals.forEach((s, i) => {
      const value = 1e-3 * (signals[i] ?? 0);
      if (s.group === 'error' && Number.isFinite(value)) errors[s.body] = value;
    });
  return errors;
}

/** |f_t| / (mu f_n) of a contact, 0 to 1. */
export function frictionUse({ force, normal, friction }: Contact): number {
  const along = force[0] * normal[0] + force[1] * normal[1] + force[2] * normal[2];
  const limit = friction * Math.abs(along);
  return limit > 0 ? Math.hypot(...force.map((f, k) => f - along * (normal[k] ?? 0))) / limit : 0;
}

/** The largest friction use among the contacts of every body; NaN: nothing touches it. */
export function bodyFriction(scene: SceneMessage, contacts: readonly Contact[]): Float64Array {
  const uses = new Float64Array(scene.bodies.length).fill(NaN);
  for (const c of contacts)
    for (const body of [c.a, c.b]) if (body >= 0) uses[body] = Math.max(uses[body] || 0, frictionUse(c));
  return uses;
}

/** Cold to hot: share of `full`, on a root scale so that small values show. */
export function heat(share: number, out: THREE.Color): THREE.Color {
  const t = Math.sqrt(Math.min(1, Math.max(0, share)));
  return out.setHSL(0.6 - 0.6 * t, 0.75, 0.45 + 0.1 * t);
}

/** Styles for BodiesView: rgb and share, a body. `values` [m or 1] are drawn hottest at `full`, NaN in the
 * file's colour. `marked`: bodies lit up by pointer or pick. */
export function styles(
  scene: SceneMessage,
  colouring: Colouring,
  values: Float64Array,
  full: number,
  marked: ReadonlySet<number>,
  shown: (body: number) => number = () => 1,
): Float32Array {
  const count = scene.bodies.length;
  const out = new Float32Array(8 * Math.max(1, count));
  const tone = new THREE.Color();
  scene.bodies.forEach((body, b) => {
    const free = scene.roots[body.root]?.base === 'free';
    let share = 0;
    if (isMeasured(colouring)) {
      const value = values[b] ?? 0;
      heat(value / full, tone);
      share = Number.isNaN(value) ? 0 : 0.9;
    } else if (colouring === 'roles') {
      tone.set(free ? COLORS.free : body.interface ? COLORS.interface : COLORS.interior);
      share = 0.92;
    } else if (colouring === 'tips' && body.interface) {
      tone.set(COLORS.interface);
      share = 0.85;
    }
    if (marked.has(b)) {
      if (share === 0) tone.set(COLORS.pull);
      else tone.lerp(new THREE.Color(COLORS.pull), 0.5);
      share = Math.max(share, 0.55);
    }
    out.set([tone.r, tone.g, tone.b, share], 4 * b);
    out[4 * (count + b)] = shown(b);
  });
  return out;
}
