// The poses that the recovery mode which is not the simulation's own would give for the same reduced state.
import type { Frame, JointInfo, Maps, SceneMessage } from '../wire/messages';
import { bodyPoses } from './reference';
import { compose, cross, exp, fromNumbers, rotate, type Rigid, type Vec3 } from './rigid';

type Twist = [w: Vec3, v: Vec3];

const sum = (a: Vec3, b: Vec3, scale = 1): Vec3 => [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]];

function moved(X: Rigid, [w, v]: Twist): Twist {
  const turned = rotate(X.q, w);
  return [turned, sum(rotate(X.q, v), cross(X.p, turned))];
}

// Of Gauss and Legendre on [0, 1], five places: to rounding for joints that turn by less than half a turn.
const PLACES = [0.04691007703066802, 0.23076534494715845, 0.5, 0.7692346550528415, 0.953089922969332];
const WEIGHTS = [0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324, 0.11846344252809454];

/** What a joint at displacements q does while they change by dq, dexp(S q) S dq = ∫ Ad(Exp(s S q)) S dq ds, s from 0 to 1. */
function change(at: Twist, by: Twist): Twist {
  const total: Twist = [
    [0, 0, 0],
    [0, 0, 0],
  ];
  PLACES.forEach((s, i) => {
    const [w, v] = moved(exp(sum([0, 0, 0], at[0], s), sum([0, 0, 0], at[1], s)), by);
    total[0] = sum(total[0], w, WEIGHTS[i]);
    total[1] = sum(total[1], v, WEIGHTS[i]);
  });
  return total;
}

function screwSum(scene: SceneMessage, joint: JointInfo, q: (coordinate: number) => number): Twist {
  const total: Twist = [
    [0, 0, 0],
    [0, 0, 0],
  ];
  for (let i = joint.offset; i < joint.offset + joint.size; ++i) {
    const s = scene.screws[i] ?? [];
    for (let k = 0; k < 3; ++k) {
      total[0][k] = (total[0][k] ?? 0) + (s[k] ?? 0) * q(i);
      total[1][k] = (total[1][k] ?? 0) + (s[k + 3] ?? 0) * q(i);
    }
  }
  return total;
}

/** Exp(T_B z) X_RB(q_ref) of one body, from the joints on its path (docs/method.md, 2.3). */
function byTwist(scene: SceneMessage, body: number, first: number, maps: Maps, z: Float32Array): Rigid {
  const rate = (i: number): number => {
    let total = 0;
    for (let k = 0; k < maps.r; ++k) total += (maps.Q[(i - first) * maps.r + k] ?? 0) * (z[k] ?? 0);
    return total;
  };
  const path: JointInfo[] = [];
  for (let j = scene.bodies[body]?.last_joint ?? -1; j >= 0; j = scene.joints[j]?.previous ?? -1) {
    const joint = scene.joints[j];
    if (joint) path.unshift(joint);
  }
  let prefix: Rigid = { p: [0, 0, 0], q: [0, 0, 0, 1] };
  const T: Twist = [
    [0, 0, 0],
    [0, 0, 0],
  ];
  for (const joint of path) {
    const at = screwSum(scene, joint, (i) => maps.q_ref[i - first] ?? 0);
    const [w, v] = moved(prefix, change(at, screwSum(scene, joint, rate)));
    T[0] = sum(T[0], w);
    T[1] = sum(T[1], v);
    prefix = compose(prefix, exp(...at));
  }
  return compose(exp(...T), compose(prefix, fromNumbers(scene.bodies[body]?.pose ?? [])));
}

/**
 * Poses by twists where the simulation walks joints, and by joints where it takes twists. Twists of a mechanism with loops say
 * nothing of how its joints close them, and a recording from disk has joints without reduced coordinates: null.
 */
export function otherPoses(scene: SceneMessage, frame: Frame, maps: (Maps | null)[]): Rigid[] | null {
  if (scene.recovery === 'twist') {
    if (scene.roots.some((root) => (root.closures ?? 0) > 0)) return null;
    return bodyPoses(
      scene,
      frame,
      maps.map((m) => {
        const joints = m && { ...m };
        delete joints?.twist;
        return joints;
      }),
    );
  }
  if (!maps.some((m) => m !== null && m.r > 0)) return null;
  return scene.bodies.map((body, b) => {
    const state = frame.roots[body.root];
    const m = maps[body.root];
    const X_WR = fromNumbers(state?.pose ?? []);
    if (!m || !state) return compose(X_WR, fromNumbers(body.pose));
    return compose(X_WR, byTwist(scene, b, scene.roots[body.root]?.first_coordinate ?? 0, m, state.z));
  });
}
