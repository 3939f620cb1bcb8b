// The three axes of every body.
import * as THREE from 'three';
import { apply, type Rigid } from '../poses/rigid';

export class FramesView {
  readonly lines: THREE.LineSegments;
  private readonly material = new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false, transparent: true });

  constructor() {
    this.lines = new THREE.LineSegments(new THREE.BufferGeometry(), this.material);
    this.lines.frustumCulled = false;
    this.lines.renderOrder = 5;
    this.lines.visible = false;
  }

  update(poses: Rigid[], length: number): void {
    const at = new Float32Array(18 * poses.length);
    const color = new Float32Array(18 * poses.length);
    poses.forEach((X, b) => {
      for (let axis = 0; axis < 3; ++axis) {
        const tip: [number, number, number] = [0, 0, 0];
        tip[axis] = length;
        at.set(X.p, 18 * b + 6 * axis);
        at.set(apply(X, tip), 18 * b + 6 * axis + 3);
        for (const end of [0, 3]) {
          color.fill(0.12, 18 * b + 6 * axis + end, 18 * b + 6 * axis + end + 3);
          color[18 * b + 6 * axis + end + axis] = 0.85;
        }
      }
    });
    this.lines.geometry.dispose();
    this.lines.geometry = new THREE.BufferGeometry();
    this.lines.geometry.setAttribute('position', new THREE.BufferAttribute(at, 3));
    this.lines.geometry.setAttribute('color', new THREE.BufferAttribute(color, 3));
  }
}
