// Compliance ellipsoids: how far each interface body gives way to a force of one size in every direction.
import * as THREE from 'three';
import type { Rigid } from '../poses/rigid';
import { eigenSymmetric } from '../poses/symmetric';
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { reserve } from './arrows';
import { roundDown } from './stage';

// Of the model's size: what cannot move in a direction is a thin disc or rod rather than not at all, one that can be grabbed
// a thicker one.
const THIN = 0.003;
const THICK = 0.015;

/** One as it is drawn. */
export interface DrawnEllipsoid {
  body: number;
  C: readonly number[]; // xx yy zz xy xz yz [m/N], axes of the root
  turn: THREE.Quaternion; // of the root
  center: THREE.Vector3;
}

export class EllipsoidsView {
  readonly mesh: THREE.InstancedMesh;
  /** The shape that is wished for while one is dragged. */
  readonly wished: THREE.Mesh;
  readonly group = new THREE.Group();
  drawn: DrawnEllipsoid[] = [];
  private size = 1;
  private thinnest = THIN;
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
    this.wished = new THREE.Mesh(
      new THREE.SphereGeometry(1, 24, 12),
      new THREE.MeshBasicMaterial({ color: 0x8a63c4, wireframe: true, transparent: true, opacity: 0.6, depthTest: false }),
    );
    this.wished.matrixAutoUpdate = false;
    this.wished.frustumCulled = false;
    this.wished.visible = false;
    this.wished.renderOrder = 3;
    this.group.add(this.mesh, this.wished);
  }

  private matrixOf({ C, turn, center }: DrawnEllipsoid): THREE.Matrix4 {
    const { values, vectors } = eigenSymmetric(C);
    const columns = vectors.map((v) => new THREE.Vector3(...v)) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
    columns.forEach((c, i) => {
      c.applyQuaternion(turn).multiplyScalar(Math.max(this.thinnest * this.size, (values[i] ?? 0) * this.newtons));
    });
    return new THREE.Matrix4().makeBasis(...columns).setPosition(center);
  }

  /** To be dragged they stand before the bodies that they are in. */
  set grabbable(on: boolean) {
    this.thinnest = on ? THICK : THIN;
    (this.mesh.material as THREE.Material).depthTest = !on;
  }

  /** Draws what is wished for in place of one of them; null: nothing. */
  wish(from: DrawnEllipsoid | null, C: readonly number[]): void {
    this.wished.visible = from !== null;
    if (!from) return;
    this.wished.matrix.copy(this.matrixOf({ ...from, C }));
    this.wished.matrixWorldNeedsUpdate = true;
  }

  pick(ray: THREE.Raycaster): { ellipsoid: DrawnEllipsoid; point: THREE.Vector3 } | null {
    if (!this.mesh.visible) return null;
    this.mesh.boundingSphere = null; // of the instances as they now are
    const hit = ray.intersectObject(this.mesh, false)[0];
    const ellipsoid = this.drawn[hit?.instanceId ?? -1];
    return hit && ellipsoid ? { ellipsoid, point: hit.point.clone() } : null;
  }

  update(scene: SceneMessage, frame: Frame, maps: (Maps | null)[], poses: Rigid[], size: number): void {
    const bodies = maps.flatMap((m, root) =>
      (m?.compliance ?? []).map(({ body, C }) => ({ root, body: (scene.roots[root]?.first_body ?? 0) + body, C })),
    );
    this.size = size;
    const softest = Math.max(1e-12, ...bodies.flatMap((b) => eigenSymmetric(b.C).values));
    // While one is dragged all keep their scale, or it would shrink under the hand.
    if (!this.wished.visible) this.newtons = bodies.length > 0 ? roundDown((0.125 * size) / softest) : 0;
    this.drawn = [];
    reserve(this.mesh, bodies.length);
    for (const { root, body, C } of bodies) {
      const X = poses[body];
      const pose = frame.roots[root]?.pose;
      if (!X || !pose) continue;
      const turn = new THREE.Quaternion(pose[4] ?? 0, pose[5] ?? 0, pose[6] ?? 0, pose[3] ?? 1);
      this.drawn.push({ body, C, turn, center: new THREE.Vector3(...X.p) });
    }
    const count = this.drawn.length;
    this.drawn.forEach((one, i) => this.mesh.setMatrixAt(i, this.matrixOf(one)));
    this.mesh.count = count;
    this.mesh.instanceMatrix.needsUpdate = true;
  }
}
