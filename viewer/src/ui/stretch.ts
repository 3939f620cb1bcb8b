// An ellipsoid of compliance that is dragged: pulled out or pushed in along the way from its middle to where it was grabbed.
import * as THREE from 'three';
import type { DrawnEllipsoid, EllipsoidsView } from '../scene/ellipsoids_view';
import type { ShapeCard, Vector } from './shape_card';

const LEAST = 0.05; // of the length that it had along the drag
const MOST = 20;
const SEND_MS = 100; // each request builds the model again, some dozen times

/** C stretched along a unit vector u so that a principal axis along u becomes `by` times as long: S C S. */
export function stretched(C: readonly number[], u: Vector, by: number): number[] {
  const [xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0] = C;
  const full = [
    [xx, xy, xz],
    [xy, yy, yz],
    [xz, yz, zz],
  ];
  const more = Math.sqrt(by) - 1;
  const S = u.map((a, i) => u.map((b, j) => (i === j ? 1 : 0) + more * a * b));
  const entry = (i: number, j: number): number => {
    let sum = 0;
    for (let k = 0; k < 3; ++k) for (let l = 0; l < 3; ++l) sum += (S[i]?.[k] ?? 0) * (full[k]?.[l] ?? 0) * (S[l]?.[j] ?? 0);
    return sum;
  };
  return [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)];
}

export class Stretch {
  private grabbed: DrawnEllipsoid | null = null;
  private from = new THREE.Vector3(); // where it was grabbed
  private along = new THREE.Vector3(); // from its middle, in the world
  private u: Vector = [0, 0, 1]; // the same in the root
  private wished: number[] = [];
  private sentAt = 0;
  private readonly plane = new THREE.Plane();

  constructor(
    private readonly ellipsoids: EllipsoidsView,
    private readonly card: ShapeCard,
  ) {}

  get on(): boolean {
    return this.grabbed !== null;
  }

  /** Whether the ray hits an ellipsoid, which is grabbed then. */
  begin(ray: THREE.Raycaster, view: THREE.Vector3): boolean {
    const hit = this.ellipsoids.pick(ray);
    if (!hit) return false;
    this.along.copy(hit.point).sub(hit.ellipsoid.center);
    if (!(this.along.length() > 0)) return false;
    this.grabbed = hit.ellipsoid;
    this.from.copy(hit.point);
    this.along.normalize();
    this.wished = [];
    this.card.begin();
    this.plane.setFromNormalAndCoplanarPoint(view, hit.point);
    return true;
  }

  move(ray: THREE.Raycaster, now: number): void {
    const { grabbed } = this;
    const target = ray.ray.intersectPlane(this.plane, new THREE.Vector3());
    if (!grabbed || !target) return;
    const long = this.from.distanceTo(grabbed.center);
    const by = THREE.MathUtils.clamp(target.sub(grabbed.center).dot(this.along) / long, LEAST, MOST);
    const { x, y, z } = this.along.clone().applyQuaternion(grabbed.turn.clone().invert());
    this.u = [x, y, z];
    this.wished = stretched(grabbed.C, this.u, by);
    this.ellipsoids.wish(grabbed, this.wished);
    if (now - this.sentAt < SEND_MS) return;
    this.sentAt = now;
    this.ask();
  }

  private ask(): void {
    if (this.grabbed && this.wished.length === 6) this.card.ask(this.grabbed.body, this.wished, this.u);
  }

  end(): void {
    this.ask();
    this.grabbed = null;
    this.ellipsoids.wish(null, []);
  }
}
