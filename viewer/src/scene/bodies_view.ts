// All moving bodies: one geometry, one draw call, any number of copies.
import * as THREE from 'three';
import type { PoseSolver } from '../poses/gpu';
import type { GeometryMessage, MeshData, SceneMessage } from '../wire/messages';
import type { Rigid } from '../poses/rigid';
import { apply } from '../poses/rigid';
import { posedDepth, posedIdentity, posedSurface, type PosedUniforms } from './posed_material';
import { Picker } from './picker';
import { mergeShapes, type MergedShapes } from './shapes';

export class BodiesView {
  readonly group = new THREE.Group();
  readonly picker = new Picker();
  readonly uniforms: PosedUniforms = {
    poseQ: { value: null },
    poseP: { value: null },
    styles: { value: null },
    spread: { value: new THREE.Vector3(1, 0, 0) },
  };
  private readonly surface = posedSurface(this.uniforms, { roughness: 0.62, metalness: 0.04 });
  private readonly depth = posedDepth(this.uniforms);
  private readonly identity = posedIdentity(this.uniforms);
  private readonly stillMaterial = new THREE.MeshStandardMaterial({ vertexColors: true, roughness: 0.85 });
  private merged: MergedShapes | null = null;
  private moving: THREE.Mesh | null = null;
  private styles: THREE.DataTexture | null = null;

  show(message: GeometryMessage, meshes: MeshData[], collision: boolean): void {
    this.group.clear();
    this.merged?.moving?.dispose();
    this.merged?.still?.dispose();
    this.merged = mergeShapes(message, meshes, collision);
    if (this.merged.still) {
      const still = new THREE.Mesh(this.merged.still, this.stillMaterial);
      still.castShadow = still.receiveShadow = true;
      this.group.add(still);
    }
    const geometry = this.merged.moving;
    this.moving = null;
    if (!geometry) return;
    const instanced = new THREE.InstancedBufferGeometry();
    instanced.setIndex(geometry.index);
    for (const name of ['position', 'normal', 'color', 'body'])
      instanced.setAttribute(name, geometry.getAttribute(name) as THREE.BufferAttribute);
    instanced.instanceCount = 1;
    this.moving = new THREE.Mesh(instanced, this.surface);
    this.moving.frustumCulled = false;
    this.moving.castShadow = this.moving.receiveShadow = true;
    this.moving.customDepthMaterial = this.depth;
    this.group.add(this.moving);
    this.picker.use(instanced, this.identity);
  }

  use(solver: PoseSolver, columns = 1, distance = 0): void {
    this.uniforms.poseQ.value = solver.quaternions;
    this.uniforms.poseP.value = solver.positions;
    this.uniforms.spread.value.set(columns, distance, 0.5 * (columns - 1) * distance);
    if (this.moving) (this.moving.geometry as THREE.InstancedBufferGeometry).instanceCount = solver.copies;
  }

  /** Tones over the file's colours: rgb and how much of it, four numbers from 0 to 1 a body. */
  setStyles(styles: Float32Array): void {
    const width = styles.length / 4;
    if (!this.styles || this.styles.image.width !== width) {
      this.styles?.dispose();
      this.styles = new THREE.DataTexture(new Float32Array(4 * width), width, 1, THREE.RGBAFormat, THREE.FloatType);
      this.uniforms.styles.value = this.styles;
    }
    (this.styles.image.data as Float32Array).set(styles);
    this.styles.needsUpdate = true;
  }

  get geometry(): THREE.BufferGeometry | null {
    return this.merged?.moving ?? null;
  }

  get planes(): MergedShapes['planes'] {
    return this.merged?.planes ?? [];
  }

  get triangles(): number {
    return (this.merged?.moving?.index?.count ?? 0) / 3;
  }

  /** Box around all moving shapes at these poses. */
  box(scene: SceneMessage, poses: Rigid[]): THREE.Box3 {
    const box = new THREE.Box3();
    const geometry = this.merged?.moving;
    if (geometry) {
      const p = geometry.getAttribute('position');
      const body = geometry.getAttribute('body');
      const at = new THREE.Vector3();
      for (let i = 0; i < p.count; ++i) {
        const X = poses[body.getX(i)];
        if (X) box.expandByPoint(at.set(...apply(X, [p.getX(i), p.getY(i), p.getZ(i)])));
      }
    }
    if (box.isEmpty()) for (const X of poses) box.expandByPoint(new THREE.Vector3(...X.p));
    if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    if (box.getSize(new THREE.Vector3()).length() < 1e-3) box.expandByScalar(Math.max(0.05, scene.radius));
    return box;
  }
}
