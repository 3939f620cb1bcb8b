// Pointer to requests: drag a body, push it with a click, turn the camera beside it.
import * as THREE from 'three';
import type { BodiesView } from '../scene/bodies_view';
import type { Hit } from '../scene/picker';
import type { Stage } from '../scene/stage';
import type { Stretch } from './stretch';

export interface PointerActions {
  canTouch(): boolean;
  picking(): boolean;
  /** A click chooses a body to look at, rather than pushing it. */
  selecting(): boolean;
  select(body: number): void;
  /** Ellipsoids of compliance may be dragged; null: not now. */
  stretching(): Stretch | null;
  pull(body: number, point: THREE.Vector3, target: THREE.Vector3): void;
  release(): void;
  push(body: number, point: THREE.Vector3, direction: THREE.Vector3): void;
  choose(body: number): void;
  /** The body under the pointer, -1: none; where that is in pixels. */
  hover(body: number, x: number, y: number): void;
  /** Where the grabbed point now is in the world. */
  worldPoint(body: number, point: THREE.Vector3): THREE.Vector3;
}

const CLICK_PIXELS = 5;

export class Pointer {
  private hit: Hit | null = null;
  private start = { x: 0, y: 0 };
  private moved = false;
  private readonly plane = new THREE.Plane();
  private readonly ray = new THREE.Raycaster();
  private hoverAt: { x: number; y: number } | null = null;
  private stretch: Stretch | null = null; // while it goes on

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly stage: Stage,
    private readonly bodies: BodiesView,
    private readonly actions: PointerActions,
  ) {
    canvas.addEventListener('pointerdown', (e) => this.down(e), { capture: true });
    canvas.addEventListener('pointermove', (e) => this.move(e));
    for (const name of ['pointerup', 'pointercancel'] as const) canvas.addEventListener(name, (e) => this.up(e));
    canvas.addEventListener('pointerleave', () => this.hoverNothing());
    window.addEventListener('blur', () => this.drop());
  }

  private place(event: PointerEvent): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  private down(event: PointerEvent): void {
    if (event.button !== 0 || !event.isPrimary || !(this.actions.canTouch() || this.actions.selecting())) return;
    const at = this.place(event);
    this.hoverNothing();
    this.stretch = this.actions.canTouch() ? this.actions.stretching() : null;
    if (this.stretch?.begin(this.aim(at), this.stage.camera.getWorldDirection(new THREE.Vector3()))) {
      this.stage.controls.enabled = false;
      this.canvas.setPointerCapture(event.pointerId);
      return;
    }
    this.stretch = null;
    this.hit = this.bodies.picker.pick(this.stage.renderer, this.stage.camera, at.x, at.y);
    this.start = at;
    this.moved = false;
    if (!this.hit) return;
    this.stage.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    const world = this.actions.worldPoint(this.hit.body, this.hit.point);
    this.plane.setFromNormalAndCoplanarPoint(this.stage.camera.getWorldDirection(new THREE.Vector3()), world);
  }

  private hoverNothing(): void {
    this.hoverAt = null;
    this.actions.hover(-1, 0, 0);
  }

  private aim(at: { x: number; y: number }): THREE.Raycaster {
    const { width, height } = this.canvas.getBoundingClientRect();
    const device = new THREE.Vector2((2 * at.x) / width - 1, 1 - (2 * at.y) / height);
    this.ray.setFromCamera(device, this.stage.camera);
    return this.ray;
  }

  private target(at: { x: number; y: number }): THREE.Vector3 | null {
    return this.aim(at).ray.intersectPlane(this.plane, new THREE.Vector3());
  }

  private move(event: PointerEvent): void {
    const at = this.place(event);
    if (this.stretch) {
      this.stretch.move(this.aim(at), performance.now());
      return;
    }
    if (!this.hit) {
      if (event.buttons === 0) this.hoverAt = at;
      return;
    }
    if (Math.hypot(at.x - this.start.x, at.y - this.start.y) > CLICK_PIXELS) this.moved = true;
    if (!this.moved || this.actions.picking() || !this.actions.canTouch()) return;
    const target = this.target(at);
    if (target) this.actions.pull(this.hit.body, this.hit.point, target);
    this.canvas.classList.add('pulling');
  }

  private up(event: PointerEvent): void {
    if (this.stretch) this.drop();
    if (!this.hit) return;
    const hit = this.hit;
    const clicked = !this.moved && event.type === 'pointerup';
    this.drop();
    if (!clicked) return;
    if (this.actions.picking()) this.actions.choose(hit.body);
    else if (this.actions.selecting() && !event.shiftKey) this.actions.select(hit.body);
    else if (this.actions.canTouch()) this.actions.push(hit.body, hit.point, this.ray.ray.direction.copy(this.rayAt(this.start)));
  }

  private rayAt(at: { x: number; y: number }): THREE.Vector3 {
    this.target(at);
    return this.ray.ray.direction.clone();
  }

  private drop(): void {
    this.stretch?.end();
    this.stretch = null;
    if (this.hit && this.moved) this.actions.release();
    this.hit = null;
    this.stage.controls.enabled = true;
    this.canvas.classList.remove('pulling');
  }

  /** Once a frame: a pick costs a read-back, so hovering does at most one. */
  update(): void {
    if (!this.hoverAt || this.hit) return;
    const { x, y } = this.hoverAt;
    this.hoverAt = null;
    const hit = this.bodies.picker.pick(this.stage.renderer, this.stage.camera, x, y);
    this.canvas.classList.toggle('grab', hit !== null && !this.actions.picking());
    this.actions.hover(hit?.body ?? -1, x, y);
  }
}
