// Shapes to triangles: one buffer for everything that moves, so that a mechanism is one draw.
import * as THREE from 'three';
import { mergeVertices, toCreasedNormals } from 'three/addons/utils/BufferGeometryUtils.js';
import type { GeometryMessage, MeshData, ShapeInfo } from '../wire/messages';

/** Of MuJoCo's convention: groups from 3 on hold collision shapes that models do not show. */
const FIRST_HIDDEN_GROUP = 3;

const ALONG_Z = new THREE.Matrix4().makeRotationX(Math.PI / 2); // three's cylinders stand along y

function meshGeometry(mesh: MeshData): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(mesh.positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.triangles, 1));
  // Files give no normals here: smooth where the surface is, sharp at edges of more than 40 degrees.
  const creased = toCreasedNormals(mergeVertices(geometry, 1e-6), (40 * Math.PI) / 180);
  geometry.dispose();
  return creased;
}

function shapeGeometry(shape: ShapeInfo, meshes: THREE.BufferGeometry[]): THREE.BufferGeometry | null {
  const [a = 0, b = 0, c = 0] = shape.size ?? [];
  switch (shape.kind) {
    case 'sphere':
      return new THREE.SphereGeometry(a, 32, 20);
    case 'capsule':
      return new THREE.CapsuleGeometry(a, 2 * b, 10, 28).applyMatrix4(ALONG_Z);
    case 'cylinder':
      return new THREE.CylinderGeometry(a, a, 2 * b, 40).applyMatrix4(ALONG_Z);
    case 'ellipsoid':
      return new THREE.SphereGeometry(1, 32, 20).scale(a, b, c);
    case 'box':
      return new THREE.BoxGeometry(2 * a, 2 * b, 2 * c);
    case 'mesh':
    case 'heightfield':
      return meshes[shape.mesh ?? -1]?.clone() ?? null;
    default:
      return null; // planes are the ground's affair
  }
}

export interface MergedShapes {
  /** position, normal, color, body; null where there is nothing */
  moving: THREE.BufferGeometry | null;
  still: THREE.BufferGeometry | null;
  planes: ShapeInfo[];
}

function poseMatrix(shape: ShapeInfo): THREE.Matrix4 {
  const [x, y, z, qw, qx, qy, qz] = shape.pose;
  return new THREE.Matrix4().compose(
    new THREE.Vector3(x, y, z),
    new THREE.Quaternion(qx, qy, qz, qw),
    new THREE.Vector3(1, 1, 1),
  );
}

function merge(parts: { geometry: THREE.BufferGeometry; shape: ShapeInfo }[]): THREE.BufferGeometry | null {
  let vertices = 0;
  let indices = 0;
  for (const { geometry } of parts) {
    vertices += geometry.getAttribute('position').count;
    indices += geometry.index?.count ?? geometry.getAttribute('position').count;
  }
  if (indices === 0) return null;
  const position = new Float32Array(3 * vertices);
  const normal = new Float32Array(3 * vertices);
  const color = new Float32Array(3 * vertices);
  const body = new Float32Array(vertices);
  const index = new Uint32Array(indices);
  let v = 0;
  let i = 0;
  const tone = new THREE.Color();
  for (const { geometry, shape } of parts) {
    geometry.applyMatrix4(poseMatrix(shape));
    const p = geometry.getAttribute('position');
    position.set(p.array as Float32Array, 3 * v);
    normal.set(geometry.getAttribute('normal').array as Float32Array, 3 * v);
    tone.setRGB(shape.rgba[0], shape.rgba[1], shape.rgba[2], THREE.SRGBColorSpace);
    for (let k = 0; k < p.count; ++k) color.set([tone.r, tone.g, tone.b], 3 * (v + k));
    body.fill(shape.body, v, v + p.count);
    const own = geometry.index;
    const count = own?.count ?? p.count;
    for (let k = 0; k < count; ++k) index[i + k] = v + (own ? own.getX(k) : k);
    v += p.count;
    i += count;
    geometry.dispose();
  }
  const merged = new THREE.BufferGeometry();
  merged.setAttribute('position', new THREE.BufferAttribute(position, 3));
  merged.setAttribute('normal', new THREE.BufferAttribute(normal, 3));
  merged.setAttribute('color', new THREE.BufferAttribute(color, 3));
  merged.setAttribute('body', new THREE.BufferAttribute(body, 1));
  merged.setIndex(new THREE.BufferAttribute(index, 1));
  return merged;
}

/** Bodies whose only shapes are hidden ones show them after all: better a hull than nothing. */
function isShown(shape: ShapeInfo, collision: boolean, seen: Set<number>): boolean {
  if (shape.rgba[3] === 0) return false;
  if (collision) return shape.collides;
  return shape.group < FIRST_HIDDEN_GROUP || !seen.has(shape.body);
}

/** `collision`: the shapes that contact sees in place of those that are meant to be seen. */
export function mergeShapes(message: GeometryMessage, meshData: MeshData[], collision: boolean): MergedShapes {
  const meshes = meshData.map(meshGeometry);
  const seen = new Set(
    message.shapes.filter((s) => s.group < FIRST_HIDDEN_GROUP && s.rgba[3] > 0).map((s) => s.body),
  );
  const moving: { geometry: THREE.BufferGeometry; shape: ShapeInfo }[] = [];
  const still: typeof moving = [];
  const planes: ShapeInfo[] = [];
  for (const shape of message.shapes) {
    if (shape.kind === 'plane') {
      planes.push(shape);
      continue;
    }
    if (!isShown(shape, collision, seen)) continue;
    const geometry = shapeGeometry(shape, meshes);
    if (!geometry) continue;
    (shape.body < 0 ? still : moving).push({ geometry, shape });
  }
  for (const mesh of meshes) mesh.dispose();
  return { moving: merge(moving), still: merge(still), planes };
}
