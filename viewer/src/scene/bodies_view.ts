// All moving bodies: a draw for each kind of mechanism that comes often, one for all others, any number of copies.
import * as THREE from 'three';
import type { PoseLists } from '../poses/gpu';
import { listTexture, numbers } from '../poses/lists';
import type { RootInfo, SceneMessage, Shapes } from '../wire/messages';
import type { Rigid } from '../poses/rigid';
import { apply } from '../poses/rigid';
import { definePictures, Pictures } from './pictures';
import { posedDepth, posedIdentity, posedSurface, posedUniforms, stillSurface, usePoses, type PosedUniforms } from './posed_material';
import { Picker } from './picker';
import { instancesOf, mergeShapes, type Batch, type MergedShapes, type ShapeChoice } from './shapes';

export class BodiesView {
  readonly group = new THREE.Group();
  readonly picker = new Picker();
  readonly uniforms: PosedUniforms = posedUniforms();
  private readonly surface = posedSurface(this.uniforms, { roughness: 0.62, metalness: 0.04 });
  private readonly depth = posedDepth(this.uniforms);
  private readonly identity = posedIdentity(this.uniforms);
  private readonly stillMaterial = stillSurface(this.uniforms, { roughness: 0.85 });
  private pictured: Shapes | null = null; // whose pictures these are
  pictures = new Pictures([]);
  private merged: MergedShapes | null = null;
  private stillOn = true;
  private readonly moving: THREE.Mesh[] = [];
  private styles: THREE.DataTexture | null = null;

  show(shapes: Shapes, roots: RootInfo[], choice: ShapeChoice): void {
    this.group.clear();
    for (const batch of this.batches) batch.geometry.dispose();
    this.merged?.still?.dispose();
    this.merged = mergeShapes(shapes, roots, choice);
    if (this.pictured !== shapes) {
      this.pictures.dispose();
      this.pictures = new Pictures(shapes.pictures);
      this.pictured = shapes;
      this.uniforms.pictures.value = this.pictures.texture;
      for (const material of [this.surface, this.stillMaterial]) definePictures(material, this.pictures.texture !== null);
    }
    if (this.merged.still) {
      const still = new THREE.Mesh(this.merged.still, this.stillMaterial);
      still.castShadow = still.receiveShadow = true;
      still.visible = this.stillOn;
      this.group.add(still);
    }
    for (const mesh of this.moving) mesh.geometry.dispose();
    this.moving.length = 0;
  }

  use(poses: PoseLists, columns = 1, distance = 0): void {
    usePoses(this.uniforms, poses);
    this.uniforms.spread.value.set(columns, distance, 0.5 * (columns - 1) * distance);
    for (const mesh of this.moving) {
      this.group.remove(mesh);
      mesh.geometry.dispose();
    }
    this.moving.length = 0;
    for (const batch of this.batches) {
      const mesh = new THREE.Mesh(instancesOf(batch, poses.copies), this.surface);
      mesh.frustumCulled = false;
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.customDepthMaterial = this.depth;
      this.moving.push(mesh);
      this.group.add(mesh);
    }
    this.picker.use(
      this.moving.map((mesh) => mesh.geometry),
      this.identity,
    );
  }

  /** The still world's shapes. */
  showStill(on: boolean): void {
    this.stillOn = on;
    for (const child of this.group.children)
      if (child instanceof THREE.Mesh && child.material === this.stillMaterial) child.visible = on;
  }

  /** Tones over the file's colours: rgb and how much of it, four numbers from 0 to 1 a body; then four more a body, the
   * first of which is how much of it is shown. */
  setStyles(styles: Float32Array): void {
    const list = this.styles;
    if (!list || numbers(list).length < styles.length) {
      list?.dispose();
      this.styles = listTexture(styles.length / 4);
      this.uniforms.styles.value = this.styles;
    }
    if (!this.styles) return;
    numbers(this.styles).set(styles);
    this.styles.needsUpdate = true;
  }

  get batches(): readonly Batch[] {
    return this.merged?.moving ?? [];
  }

  get planes(): MergedShapes['planes'] {
    return this.merged?.planes ?? [];
  }

  get picturedPlanes(): MergedShapes['pictured'] {
    return this.merged?.pictured ?? [];
  }

  /** Triangles of all members of all batches, drawn once each. */
  get triangles(): number {
    return this.batches.reduce((sum, { geometry, firsts }) => sum + (firsts.length * (geometry.index?.count ?? 0)) / 3, 0);
  }

  /** Box around all moving shapes at these poses. */
  box(scene: SceneMessage, poses: Rigid[]): THREE.Box3 {
    const box = new THREE.Box3();
    const at = new THREE.Vector3();
    for (const { geometry, firsts } of this.batches) {
      const points = firsts.length > 1 ? corners(geometry) : vertices(geometry);
      for (const first of firsts)
        for (const { body, p } of points) {
          const X = poses[first + body];
          if (X) box.expandByPoint(at.set(...apply(X, p)));
        }
    }
    if (box.isEmpty()) for (const X of poses) box.expandByPoint(new THREE.Vector3(...X.p));
    if (box.isEmpty()) box.set(new THREE.Vector3(-1, -1, -1), new THREE.Vector3(1, 1, 1));
    if (box.getSize(new THREE.Vector3()).length() < 1e-3) box.expandByScalar(Math.max(0.05, scene.radius));
    return box;
  }
}

interface BodyPoint {
  body: number;
  p: [number, number, number];
}

function vertices(geometry: THREE.BufferGeometry): BodyPoint[] {
  const p = geometry.getAttribute('position');
  const body = geometry.getAttribute('body');
  return Array.from({ length: p.count }, (_, i) => ({ body: body.getX(i), p: [p.getX(i), p.getY(i), p.getZ(i)] }));
}

/** Eight points a body in place of its vertices: near enough where there are many bodies. */
function corners(geometry: THREE.BufferGeometry): BodyPoint[] {
  const boxes = new Map<number, THREE.Box3>();
  for (const { body, p } of vertices(geometry)) {
    const box = boxes.get(body) ?? new THREE.Box3();
    boxes.set(body, box.expandByPoint(new THREE.Vector3(...p)));
  }
  return [...boxes].flatMap(([body, { min, max }]) =>
    [min.x, max.x].flatMap((x) =>
      [min.y, max.y].flatMap((y) => [min.z, max.z].map((z): BodyPoint => ({ body, p: [x, y, z] }))),
    ),
  );
}
