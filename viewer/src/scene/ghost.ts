// The same bodies again, translucent: at the reference pose, or where another simulation has them.
import * as THREE from 'three';
import type { PoseSolver } from '../poses/gpu';
import { posedSurface, type PosedUniforms } from './posed_material';

export class Ghost {
  readonly group = new THREE.Group();
  private readonly uniforms: PosedUniforms;
  private readonly material: THREE.Material;

  constructor(styles: PosedUniforms['styles'], color: number) {
    this.uniforms = {
      poseQ: { value: null },
      poseP: { value: null },
      styles,
      spread: { value: new THREE.Vector3(1, 0, 0) },
    };
    this.material = posedSurface(this.uniforms, {
      vertexColors: false,
      color,
      transparent: true,
      opacity: 0.22,
      roughness: 1,
      depthWrite: false,
    });
    this.group.visible = false;
  }

  use(solver: PoseSolver, geometry: THREE.BufferGeometry | null): void {
    this.uniforms.poseQ.value = solver.quaternions;
    this.uniforms.poseP.value = solver.positions;
    this.group.clear();
    if (!geometry) return;
    const instanced = new THREE.InstancedBufferGeometry();
    instanced.setIndex(geometry.index);
    for (const name of ['position', 'normal', 'body'])
      instanced.setAttribute(name, geometry.getAttribute(name) as THREE.BufferAttribute);
    instanced.instanceCount = 1;
    const mesh = new THREE.Mesh(instanced, this.material);
    mesh.frustumCulled = false;
    mesh.renderOrder = 2;
    this.group.add(mesh);
  }
}
