// Arrows from points along forces: one instanced draw for shafts, one for heads.
import * as THREE from 'three';

/** Visible through bodies. `transparent` puts it behind the ground's pictures in the order of drawing, which are transparent too. */
export const OVER_BODIES = { depthTest: false, transparent: true };

export class Arrows {
  readonly group = new THREE.Group();
  private readonly shafts: THREE.InstancedMesh;
  private readonly heads: THREE.InstancedMesh;
  private readonly matrix = new THREE.Matrix4();
  private readonly turn = new THREE.Quaternion();
  private readonly direction = new THREE.Vector3();
  private readonly at = new THREE.Vector3();
  private readonly size = new THREE.Vector3();

  constructor(color: number) {
    const material = new THREE.MeshStandardMaterial({ color, roughness: 0.5, emissive: color, emissiveIntensity: 0.25, ...OVER_BODIES });
    const shaft = new THREE.CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0);
    const head = new THREE.ConeGeometry(1, 1, 16).translate(0, 0.5, 0);
    this.shafts = new THREE.InstancedMesh(shaft, material, FIRST_ROOM);
    this.heads = new THREE.InstancedMesh(head, material, FIRST_ROOM);
    for (const mesh of [this.shafts, this.heads]) {
      mesh.frustumCulled = false;
      mesh.count = 0;
      mesh.renderOrder = 3; // forces inside a body are drawn over it
      this.group.add(mesh);
    }
  }

  /** At most `most` arrows follow. */
  begin(most: number): void {
    reserve(this.shafts, most);
    reserve(this.heads, most);
    this.shafts.count = this.heads.count = 0;
  }

  /** An arrow of the given vector, `width` thick; ones too short to see are left out. */
  add(from: [number, number, number], vector: [number, number, number], width: number): void {
    const length = Math.hypot(...vector);
    const i = this.shafts.count;
    if (length < 2 * width) return;
    const headLength = Math.min(0.45 * length, 6 * width);
    this.direction.set(...vector).divideScalar(length);
    this.turn.setFromUnitVectors(UP, this.direction);
    this.at.set(...from);
    this.matrix.compose(this.at, this.turn, this.size.set(width, length - headLength, width));
    this.shafts.setMatrixAt(i, this.matrix);
    this.at.addScaledVector(this.direction, length - headLength);
    this.matrix.compose(this.at, this.turn, this.size.set(2.4 * width, headLength, 2.4 * width));
    this.heads.setMatrixAt(i, this.matrix);
    this.shafts.count = this.heads.count = i + 1;
  }

  end(): void {
    this.shafts.instanceMatrix.needsUpdate = this.heads.instanceMatrix.needsUpdate = true;
  }

  get count(): number {
    return this.shafts.count;
  }
}

const UP = new THREE.Vector3(0, 1, 0);
const FIRST_ROOM = 64;

/** Room for `count` instances in a mesh that is written again each frame. */
export function reserve(mesh: THREE.InstancedMesh, count: number): void {
  if (count <= mesh.instanceMatrix.count) return;
  mesh.dispose(); // the buffer on the GPU, not the mesh
  const room = 2 ** Math.ceil(Math.log2(count));
  mesh.instanceMatrix = new THREE.InstancedBufferAttribute(new Float32Array(16 * room), 16);
}
