// Compliance ellipsoids: how far each interface body gives way to a force of one size in every direction.
import * as THREE from 'three';
import type { Rigid } from '../poses/rigid';
import { eigenSymmetric } from '../poses/symmetric';
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { reserve } from './arrows';
import { roundDown } from './stage';

export class EllipsoidsView {
  readonly mesh: THREE.InstancedMesh;
  /** the force [N] whose motion is drawn to scale: the softest axis is about an eighth of the model */
  newtons = 0;

  constructor() {
    const material = new THREE.MeshStandardMaterial({
      color: 0x8a63c4,
      transparent: true,
      opacity: 0.35,
      roughness: 0.6,
      depthWrite: false,
    });
    this.mesh = new THREE.InstancedMesh(new THREE.SphereGeometry(1, 32, 20), material, 64);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.mesh.renderOrder = 2;
  }

  update(scene: SceneMessage, frame: Frame, maps: (Maps | null)[], poses: Rigid[], size: number): void {
    const bodies = maps.flatMap((m, root) =>
      (m?.compliance ?? []).map(({ body, C }) => ({ root, body: (scene.roots[root]?.first_body ?? 0) + body, C })),
    );
    const solved = bodies.map((b) => ({ ...b, ...eigenSymmetric(b.C) }));
    const softest = Math.max(1e-12, ...solved.flatMap((s) => s.values));
    this.newtons = solved.length > 0 ? roundDown((0.125 * size) / softest) : 0;
    const matrix = new THREE.Matrix4();
    const turn = new THREE.Quaternion();
    let count = 0;
    reserve(this.mesh, solved.length);
    for (const { root, body, values, vectors } of solved) {
      const X = poses[body];
      const pose = frame.roots[root]?.pose;
      if (!X || !pose) continue;
      const columns = vectors.map((v) => new THREE.Vector3(...v)) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
      turn.set(pose[4] ?? 0, pose[5] ?? 0, pose[6] ?? 0, pose[3] ?? 1);
      // What cannot move in a direction is drawn as a thin disc or rod rather than not at all.
      const least = 0.003 * size;
      columns.forEach((c, i) => {
        c.applyQuaternion(turn).multiplyScalar(Math.max(least, (values[i] ?? 0) * this.newtons));
      });
      matrix.makeBasis(...columns).setPosition(...X.p);
      this.mesh.setMatrixAt(count++, matrix);
    }
    this.mesh.count = count;
    this.mesh.instanceMatrix.needsUpdate = true;
  }
}
