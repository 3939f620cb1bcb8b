// Contact forces as arrows, and the friction cones they must stay in.
import * as THREE from 'three';
import type { Frame, SceneMessage } from '../wire/messages';
import { Arrows, reserve } from './arrows';
import { COLORS } from './theme';

const UP = new THREE.Vector3(0, 1, 0);

export class ContactsView {
  readonly group = new THREE.Group();
  showForces = true;
  showCones = false;
  /** metres an arrow is long per newton; 0: the longest is a sixth of the model */
  metresPerNewton = 0;
  private automatic = 0;
  private readonly arrows = new Arrows(COLORS.contact);
  private readonly cones: THREE.InstancedMesh;

  constructor() {
    const cone = new THREE.ConeGeometry(1, 1, 32, 1, true).rotateX(Math.PI).translate(0, 0.5, 0); // tip at the origin
    const material = new THREE.MeshBasicMaterial({
      color: COLORS.cone,
      transparent: true,
      opacity: 0.28,
      side: THREE.DoubleSide,
      depthWrite: false,
    });
    this.cones = new THREE.InstancedMesh(cone, material, 64);
    this.cones.frustumCulled = false;
    this.group.add(this.arrows.group, this.cones);
  }

  /** Metres per newton as now drawn: for the legend. */
  get scale(): number {
    return this.metresPerNewton > 0 ? this.metresPerNewton : this.automatic;
  }

  update(scene: SceneMessage, frame: Frame, size: number): void {
    const isFree = (body: number): boolean => scene.roots[scene.bodies[body]?.root ?? -1]?.base === 'free';
    const largest = Math.max(1e-9, ...frame.contacts.map((c) => Math.hypot(...c.force)));
    // The automatic scale shrinks at once and grows slowly, in steps that can be read.
    const wanted = (0.17 * size) / largest;
    if (this.automatic === 0 || wanted < this.automatic || wanted > 4 * this.automatic) this.automatic = wanted;
    const scale = this.scale;
    this.arrows.begin(frame.contacts.length);
    if (this.showCones) reserve(this.cones, frame.contacts.length);
    let count = 0;
    const matrix = new THREE.Matrix4();
    for (const c of frame.contacts) {
      // Drawn on what is carried or moves: the free body, else b, else a.
      const onA = c.b < 0 || (c.a >= 0 && isFree(c.a) && !isFree(c.b));
      const s = (onA ? -1 : 1) * scale;
      if (this.showForces) this.arrows.add(c.point, [s * c.force[0], s * c.force[1], s * c.force[2]], 0.0042 * size);
      if (!this.showCones || c.friction <= 0) continue;
      const height = 0.07 * size;
      const normal = new THREE.Vector3(...c.normal).multiplyScalar(onA ? -1 : 1);
      matrix.compose(
        new THREE.Vector3(...c.point),
        new THREE.Quaternion().setFromUnitVectors(UP, normal),
        new THREE.Vector3(c.friction * height, height, c.friction * height),
      );
      this.cones.setMatrixAt(count++, matrix);
    }
    this.arrows.end();
    this.cones.count = count;
    this.cones.instanceMatrix.needsUpdate = true;
  }
}
