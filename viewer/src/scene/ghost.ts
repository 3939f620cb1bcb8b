// The same bodies again, translucent: at the reference pose, or where another simulation has them.
import * as THREE from 'three';
import type { PoseLists } from '../poses/gpu';
import { posedSurface, posedUniforms, usePoses, type PosedUniforms } from './posed_material';
import { instancesOf, type Batch } from './shapes';

export class Ghost {
  readonly group = new THREE.Group();
  private readonly uniforms: PosedUniforms;
  private readonly material: THREE.Material;

  constructor(styles: PosedUniforms['styles'], color: number, opacity = 0.22) {
    this.uniforms = posedUniforms(styles);
    this.material = posedSurface(this.uniforms, {
      vertexColors: false,
      color,
      transparent: true,
      opacity,
      roughness: 1,
      depthWrite: false,
      // Where both coincide the ghost lies over the body, evenly, not in the patches that rounding leaves.
      polygonOffset: true,
      polygonOffsetFactor: -1,
      polygonOffsetUnits: -4,
    });
    this.group.visible = false;
  }

  use(poses: PoseLists, batches: readonly Batch[]): void {
    usePoses(this.uniforms, poses);
    for (const mesh of this.group.children) if (mesh instanceof THREE.Mesh) mesh.geometry.dispose();
    this.group.clear();
    for (const batch of batches) {
      const mesh = new THREE.Mesh(instancesOf(batch, poses.copies), this.material);
      mesh.frustumCulled = false;
      mesh.renderOrder = 2;
      this.group.add(mesh);
    }
  }
}
