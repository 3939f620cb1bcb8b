// The pose of every body from one frame, in double precision: what the shader is held against.
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { compose, exp, fromNumbers, type Rigid, type Vec3 } from './rigid';

/** Joint displacements of one root: q_ref + Q z + correction. */
export function displacements(maps: Maps, z: Float32Array, correction: Float32Array): Float64Array {
  const q = Float64Array.from(maps.q_ref);
  for (let i = 0; i < maps.n; ++i) {
    let sum = correction[i] ?? 0;
    for (let k = 0; k < maps.r; ++k) sum += (maps.Q[i * maps.r + k] ?? 0) * (z[k] ?? 0);
    q[i] = (q[i] ?? 0) + sum;
  }
  return q;
}

function jointTwist(scene: SceneMessage, joint: number, q: (coordinate: number) => number): [Vec3, Vec3] {
  const w: Vec3 = [0, 0, 0];
  const v: Vec3 = [0, 0, 0];
  const info = scene.joints[joint];
  if (!info) return [w, v];
  for (let i = info.offset; i < info.offset + info.size; ++i) {
    const s = scene.screws[i] ?? [];
    for (let k = 0; k < 3; ++k) {
      w[k] = (w[k] ?? 0) + (s[k] ?? 0) * q(i);
      v[k] = (v[k] ?? 0) + (s[k + 3] ?? 0) * q(i);
    }
  }
  return [w, v];
}

/** Poses of all bodies in the world. `maps` as Library.mapsOf gives them. */
export function bodyPoses(scene: SceneMessage, frame: Frame, maps: (Maps | null)[]): Rigid[] {
  const q = maps.map((m, i) => {
    const state = frame.roots[i];
    return m && state ? displacements(m, state.z, state.correction) : new Float64Array();
  });
  return scene.bodies.map((body, b) => {
    const state = frame.roots[body.root];
    const root = scene.roots[body.root];
    const m = maps[body.root];
    if (!state || !root) throw new Error(`body ${b} has no root`);
    const X_WR = fromNumbers(state.pose);
    if (!m) return compose(X_WR, fromNumbers(body.pose));
    if (m.twist) {
      const local = b - root.first_body;
      const w: Vec3 = [0, 0, 0];
      const v: Vec3 = [0, 0, 0];
      for (let k = 0; k < m.r; ++k) {
        const at = (local * m.r + k) * 6;
        for (let c = 0; c < 3; ++c) {
          w[c] = (w[c] ?? 0) + (m.twist.T[at + c] ?? 0) * (state.z[k] ?? 0);
          v[c] = (v[c] ?? 0) + (m.twist.T[at + 3 + c] ?? 0) * (state.z[k] ?? 0);
        }
      }
      return compose(X_WR, compose(exp(w, v), fromNumbers(m.twist.poses, local * 7)));
    }
    let X = fromNumbers(body.pose);
    for (let j = body.last_joint; j >= 0; j = scene.joints[j]?.previous ?? -1) {
      const [w, v] = jointTwist(scene, j, (i) => q[body.root]?.[i - root.first_coordinate] ?? 0);
      X = compose(exp(w, v), X);
    }
    return compose(X_WR, X);
  });
}
