// Shapes to triangles. What looks the same many times over is told once and drawn by instances, a thousand equal hands
// in one draw; everything else that moves is one buffer and one draw.
import * as THREE from 'three';
import { mergeVertices, toCreasedNormals } from 'three/addons/utils/BufferGeometryUtils.js';
import type { MeshData, RootInfo, ShapeInfo, Shapes } from '../wire/messages';

/** Of MuJoCo's convention: groups from 3 on hold collision shapes that models do not show. */
const FIRST_HIDDEN_GROUP = 3;

const ALONG_Z = new THREE.Matrix4().makeRotationX(Math.PI / 2); // three's cylinders stand along y

function meshGeometry(mesh: MeshData): THREE.BufferGeometry {
  let geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(mesh.positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(mesh.triangles, 1));
  if (mesh.uv.length > 0) {
    const corners = geometry.toNonIndexed();
    geometry.dispose();
    geometry = corners;
    geometry.setAttribute('uv', new THREE.BufferAttribute(mesh.uv, 2));
  }
  // Files give no normals here: smooth where the surface is, sharp at edges of more than 40 degrees.
  const creased = toCreasedNormals(mergeVertices(geometry, 1e-6), (40 * Math.PI) / 180);
  geometry.dispose();
  return creased;
}

/** `detail`: share of the facets that a round shape gets where it may fill the page. */
function shapeGeometry(shape: ShapeInfo, meshes: THREE.BufferGeometry[], detail: number): THREE.BufferGeometry | null {
  const [a = 0, b = 0, c = 0] = shape.size ?? [];
  const facets = (most: number): number => Math.max(4, Math.round(most * detail));
  switch (shape.kind) {
    case 'sphere':
      return new THREE.SphereGeometry(a, facets(32), facets(20));
    case 'capsule':
      return new THREE.CapsuleGeometry(a, 2 * b, facets(10), facets(28)).applyMatrix4(ALONG_Z);
    case 'cylinder':
      return new THREE.CylinderGeometry(a, a, 2 * b, facets(40)).applyMatrix4(ALONG_Z);
    case 'ellipsoid':
      return new THREE.SphereGeometry(1, facets(32), facets(20)).scale(a, b, c);
    case 'box':
      return new THREE.BoxGeometry(2 * a, 2 * b, 2 * c);
    case 'mesh':
    case 'heightfield':
      return meshes[shape.mesh ?? -1]?.clone() ?? null;
    default:
      return null; // planes are the ground's affair, with a picture or without
  }
}

/** Shapes that are drawn together: one draw, an instance for every entry of `firsts`. */
export interface Batch {
  /** position, normal, color, body: counted from an entry of `firsts`; pictureAt where shapes have pictures */
  geometry: THREE.BufferGeometry;
  firsts: Float32Array;
}

export interface MergedShapes {
  moving: Batch[];
  still: THREE.BufferGeometry | null;
  planes: ShapeInfo[];
  /** those of the still world that are to be seen with a picture */
  pictured: ShapeInfo[];
}

/** So many roots must look the same before instances pay. */
const FEWEST_INSTANCES = 4;
/** Facets are told apart while there are no more round shapes than this. */
const MOST_FINE_SHAPES = 400;

function poseMatrix(shape: ShapeInfo): THREE.Matrix4 {
  const [x, y, z, qw, qx, qy, qz] = shape.pose;
  return new THREE.Matrix4().compose(
    new THREE.Vector3(x, y, z),
    new THREE.Quaternion(qx, qy, qz, qw),
    new THREE.Vector3(1, 1, 1),
  );
}

/** Layer of a shape's picture, -1 where it has none or does not say where it lies. */
function layerOf(geometry: THREE.BufferGeometry, shape: ShapeInfo): number {
  return shape.kind === 'mesh' && geometry.hasAttribute('uv') ? (shape.picture ?? -1) : -1;
}

function merge(parts: { geometry: THREE.BufferGeometry; shape: ShapeInfo }[], pictured: boolean): THREE.BufferGeometry | null {
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
  const pictureAt = pictured ? new Float32Array(3 * vertices) : null;
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
    const layer = layerOf(geometry, shape);
    const uv = geometry.getAttribute('uv');
    if (pictureAt)
      for (let k = 0; k < p.count; ++k) pictureAt.set(layer < 0 ? [0, 0, -1] : [uv.getX(k), uv.getY(k), layer], 3 * (v + k));
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
  if (pictureAt) merged.setAttribute('pictureAt', new THREE.BufferAttribute(pictureAt, 3));
  merged.setIndex(new THREE.BufferAttribute(index, 1));
  return merged;
}

/** Shapes that are meant to be seen, those that contact sees, or all; and MuJoCo's groups that are left out. */
export interface ShapeChoice {
  shapes: 'visual' | 'collision' | 'both';
  hiddenGroups: ReadonlySet<number>;
}

/** Bodies whose only shapes are hidden ones show them after all: better a hull than nothing. */
function isShown(shape: ShapeInfo, choice: ShapeChoice, seen: Set<number>): boolean {
  if (shape.rgba[3] === 0 || choice.hiddenGroups.has(shape.group)) return false;
  if (choice.shapes === 'both') return true;
  if (choice.shapes === 'collision') return shape.collides;
  return shape.group < FIRST_HIDDEN_GROUP || !seen.has(shape.body);
}

/** Groups of roots whose shapes are the same, body by body; the shapes of a group count bodies from its first. */
export function groupShapes(shapes: ShapeInfo[], roots: RootInfo[]): { shapes: ShapeInfo[]; firsts: number[] }[] {
  const rootOf = new Map<number, number>();
  roots.forEach((root, r) => {
    for (let b = 0; b < root.bodies; ++b) rootOf.set(root.first_body + b, r);
  });
  const ofRoot = new Map<number, ShapeInfo[]>();
  for (const shape of shapes) {
    const root = rootOf.get(shape.body);
    if (root === undefined) continue;
    const first = roots[root]?.first_body ?? 0;
    const list = ofRoot.get(root) ?? [];
    list.push({ ...shape, body: shape.body - first });
    ofRoot.set(root, list);
  }
  const groups = new Map<string, { shapes: ShapeInfo[]; firsts: number[] }>();
  const alone: { shapes: ShapeInfo[]; firsts: number[] } = { shapes: [], firsts: [0] };
  for (const [root, list] of ofRoot) {
    const key = JSON.stringify(list, (name: string, value: unknown) => (name === 'name' ? undefined : value));
    const group = groups.get(key) ?? { shapes: list, firsts: [] };
    group.firsts.push(roots[root]?.first_body ?? 0);
    groups.set(key, group);
  }
  const out = [...groups.values()].filter((group) => group.firsts.length >= FEWEST_INSTANCES);
  for (const group of groups.values())
    if (group.firsts.length < FEWEST_INSTANCES)
      for (const first of group.firsts) alone.shapes.push(...group.shapes.map((s) => ({ ...s, body: s.body + first })));
  if (alone.shapes.length > 0) out.push(alone);
  return out;
}

/** The triangles of a batch for every member and copy; buffers are shared. */
export function instancesOf(batch: Batch, copies: number): THREE.InstancedBufferGeometry {
  const instanced = new THREE.InstancedBufferGeometry();
  instanced.setIndex(batch.geometry.index);
  for (const name of ['position', 'normal', 'color', 'body', 'pictureAt'])
    if (batch.geometry.hasAttribute(name))
      instanced.setAttribute(name, batch.geometry.getAttribute(name) as THREE.BufferAttribute);
  instanced.setAttribute('first', new THREE.InstancedBufferAttribute(batch.firsts, 1, false, copies));
  instanced.instanceCount = batch.firsts.length * copies;
  return instanced;
}

export function mergeShapes({ geometry: message, meshes: meshData, pictures }: Shapes, roots: RootInfo[], choice: ShapeChoice): MergedShapes {
  const meshes = meshData.map(meshGeometry);
  const seen = new Set(
    message.shapes.filter((s) => s.group < FIRST_HIDDEN_GROUP && s.rgba[3] > 0).map((s) => s.body),
  );
  const planes = message.shapes.filter((s) => s.kind === 'plane');
  const shown = message.shapes.filter((s) => s.kind !== 'plane' && isShown(s, choice, seen));
  const detail = Math.min(1, Math.max(0.3, Math.sqrt(MOST_FINE_SHAPES / Math.max(1, shown.length))));
  const build = (shapes: ShapeInfo[]): THREE.BufferGeometry | null =>
    merge(
      shapes.flatMap((shape) => {
        const geometry = shapeGeometry(shape, meshes, detail);
        return geometry ? [{ geometry, shape }] : [];
      }),
      pictures.length > 0,
    );
  const moving = groupShapes(shown, roots).flatMap(({ shapes, firsts }) => {
    const geometry = build(shapes);
    return geometry ? [{ geometry, firsts: new Float32Array(firsts) }] : [];
  });
  const still = build(shown.filter((s) => s.body < 0));
  for (const mesh of meshes) mesh.dispose();
  const pictured = planes.filter((s) => s.body < 0 && s.picture !== undefined && isShown(s, choice, seen));
  return { moving, still, planes, pictured };
}
