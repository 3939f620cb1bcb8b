// What a model is made of beside its shapes: joint axes, centres of mass, boxes of inertia, tendons.
import * as THREE from 'three';
import { displacements } from '../poses/reference';
import { compose, exp, fromNumbers, type Rigid, rotate, type Vec3, apply } from '../poses/rigid';
import { eigenSymmetric } from '../poses/symmetric';
import type { Frame, Maps, SceneMessage } from '../wire/messages';
import { Arrows, OVER_BODIES, reserve } from './arrows';
import { tendonPieces } from './tendon_path';
import { COLORS } from './theme';

export interface AnatomyOptions {
  axes: boolean;
  centers: boolean;
  inertia: boolean;
  tendons: boolean;
}

const UP = new THREE.Vector3(0, 1, 0);

function inverse(X: Rigid): Rigid {
  const q: Rigid['q'] = [-X.q[0], -X.q[1], -X.q[2], X.q[3]];
  const p = rotate(q, X.p);
  return { p: [-p[0], -p[1], -p[2]], q };
}

/** An axis of a joint in the world: where it passes and its direction; `turns`: rotation about it. */
export interface JointAxis {
  joint: number;
  at: Vec3;
  along: Vec3;
  turns: boolean;
}

/** Axes of all joints. `q` of every root's coordinates. */
export function jointAxes(scene: SceneMessage, poses: readonly Rigid[], q: readonly Float64Array[]): JointAxis[] {
  const out: JointAxis[] = [];
  scene.bodies.forEach((body, b) => {
    const X = poses[b];
    if (!X) return;
    const root = scene.roots[body.root];
    // What all screws of the path turn by up to joint j; taking j's own motion out leaves its axis where it is.
    let P = compose(X, inverse(fromNumbers(body.pose)));
    for (let j = body.last_joint; j >= 0; ) {
      const joint = scene.joints[j];
      if (!joint || joint.body !== b) break;
      const w: Vec3 = [0, 0, 0];
      const v: Vec3 = [0, 0, 0];
      for (let i = joint.offset; i < joint.offset + joint.size; ++i) {
        const s = scene.screws[i] ?? [];
        const turn: Vec3 = [s[0] ?? 0, s[1] ?? 0, s[2] ?? 0];
        const move: Vec3 = [s[3] ?? 0, s[4] ?? 0, s[5] ?? 0];
        const turns = Math.hypot(...turn) > 0.5;
        const anchor: Vec3 = [
          turn[1] * move[2] - turn[2] * move[1],
          turn[2] * move[0] - turn[0] * move[2],
          turn[0] * move[1] - turn[1] * move[0],
        ];
        out.push({ joint: j, at: turns ? apply(P, anchor) : X.p, along: rotate(P.q, turns ? turn : move), turns });
        const x = -(q[body.root]?.[i - (root?.first_coordinate ?? 0)] ?? 0);
        for (let k = 0; k < 3; ++k) {
          w[k] = (w[k] ?? 0) + (turn[k] ?? 0) * x;
          v[k] = (v[k] ?? 0) + (move[k] ?? 0) * x;
        }
      }
      P = compose(P, exp(w, v));
      j = joint.previous;
    }
  });
  return out;
}

/** Half sizes of the box of even density with this mass and these moments of inertia, and its axes. */
export function inertiaBox(mass: number, moments: readonly number[]): { half: Vec3; axes: [Vec3, Vec3, Vec3] } {
  const { values, vectors } = eigenSymmetric(moments);
  const [x, y, z] = values;
  const half = (a: number, b: number, c: number): number => Math.sqrt(Math.max(0, (1.5 * (a + b - c)) / Math.max(mass, 1e-12)));
  return { half: [half(y, z, x), half(z, x, y), half(x, y, z)], axes: vectors };
}

export class AnatomyView {
  readonly group = new THREE.Group();
  private readonly hinges = new Arrows(COLORS.hinge);
  private readonly slides = new Arrows(COLORS.slide);
  private readonly centers = instanced(new THREE.SphereGeometry(1, 16, 12), { color: COLORS.center, ...OVER_BODIES });
  private readonly boxes = instanced(new THREE.BoxGeometry(2, 2, 2), {
    color: COLORS.center,
    transparent: true,
    opacity: 0.3,
    depthWrite: false,
  });
  private readonly tendons = instanced(new THREE.CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0), { color: COLORS.tendon });

  constructor() {
    this.group.add(this.hinges.group, this.slides.group, this.centers, this.boxes, this.tendons);
  }

  /** How many of each are drawn now. */
  get counts(): { axes: number; centers: number; boxes: number; tendons: number } {
    return {
      axes: this.hinges.count + this.slides.count,
      centers: this.centers.count,
      boxes: this.boxes.count,
      tendons: this.tendons.count,
    };
  }

  get drawsHinges(): boolean {
    return this.hinges.count > 0;
  }
  get drawsSlides(): boolean {
    return this.slides.count > 0;
  }

  /** `shown`: whether a body is. */
  update(
    scene: SceneMessage,
    frame: Frame,
    maps: (Maps | null)[],
    poses: readonly Rigid[],
    size: number,
    options: AnatomyOptions,
    shown: (body: number) => boolean,
  ): void {
    this.updateAxes(scene, frame, maps, poses, size, options.axes, shown);
    const bodies = scene.bodies.flatMap((body, b) => {
      const X = poses[b];
      return body.mass > 0 && shown(b) && X ? [{ body, X }] : [];
    });
    const matrix = new THREE.Matrix4();
    this.centers.count = options.centers ? bodies.length : 0;
    this.boxes.count = options.inertia ? bodies.length : 0;
    reserve(this.centers, this.centers.count);
    reserve(this.boxes, this.boxes.count);
    bodies.forEach(({ body, X }, i) => {
      const at = apply(X, body.center);
      if (options.centers) this.centers.setMatrixAt(i, matrix.makeScale(0.007 * size, 0.007 * size, 0.007 * size).setPosition(...at));
      if (!options.inertia) return;
      const { half, axes } = inertiaBox(body.mass, body.inertia);
      const columns = axes.map((axis, k) =>
        new THREE.Vector3(...rotate(X.q, axis)).multiplyScalar(Math.max(half[k] ?? 0, 1e-4 * size)),
      ) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
      this.boxes.setMatrixAt(i, matrix.makeBasis(...columns).setPosition(...at));
    });
    this.updateTendons(scene, poses, size, options.tendons);
    for (const mesh of [this.centers, this.boxes, this.tendons]) mesh.instanceMatrix.needsUpdate = true;
  }

  private updateAxes(
    scene: SceneMessage,
    frame: Frame,
    maps: (Maps | null)[],
    poses: readonly Rigid[],
    size: number,
    on: boolean,
    shown: (body: number) => boolean,
  ): void {
    const q = on
      ? maps.map((m, i) => {
          const state = frame.roots[i];
          return m && state ? displacements(m, state.z, state.correction) : new Float64Array();
        })
      : [];
    const axes = on ? jointAxes(scene, poses, q).filter((a) => shown(scene.joints[a.joint]?.body ?? -1)) : [];
    const long = 0.09 * size;
    this.hinges.begin(axes.length);
    this.slides.begin(axes.length);
    for (const { at, along, turns } of axes) {
      const scale = long / (Math.hypot(...along) || 1);
      const vector: Vec3 = [along[0] * scale, along[1] * scale, along[2] * scale];
      const from: Vec3 = [at[0] - 0.5 * vector[0], at[1] - 0.5 * vector[1], at[2] - 0.5 * vector[2]];
      (turns ? this.hinges : this.slides).add(from, vector, 0.0022 * size);
    }
    this.hinges.end();
    this.slides.end();
  }

  private updateTendons(scene: SceneMessage, poses: readonly Rigid[], size: number, on: boolean): void {
    const pieces = on ? scene.tendons.flatMap((tendon) => tendonPieces(tendon, poses)) : [];
    reserve(this.tendons, pieces.length);
    this.tendons.count = pieces.length;
    const matrix = new THREE.Matrix4();
    const turn = new THREE.Quaternion();
    pieces.forEach(([a, b], i) => {
      const way = new THREE.Vector3(...b).sub(new THREE.Vector3(...a));
      const length = way.length();
      turn.setFromUnitVectors(UP, way.divideScalar(length || 1));
      matrix.compose(new THREE.Vector3(...a), turn, new THREE.Vector3(0.0025 * size, length, 0.0025 * size));
      this.tendons.setMatrixAt(i, matrix);
    });
  }
}

function instanced(geometry: THREE.BufferGeometry, options: THREE.MeshStandardMaterialParameters): THREE.InstancedMesh {
  const mesh = new THREE.InstancedMesh(geometry, new THREE.MeshStandardMaterial({ roughness: 0.6, ...options }), 64);
  mesh.frustumCulled = false;
  mesh.count = 0;
  mesh.renderOrder = 3;
  return mesh;
}
