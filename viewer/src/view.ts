// Everything that is drawn: bodies, forces, ghosts, for the frame last given.
import * as THREE from 'three';
import { PoseSolver } from './poses/gpu';
import { otherPoses } from './poses/other_recovery';
import { bodyPoses } from './poses/reference';
import { apply, type Rigid } from './poses/rigid';
import { AnatomyView } from './scene/anatomy_view';
import { Arrows } from './scene/arrows';
import { BodiesView } from './scene/bodies_view';
import { bodyErrors, bodyFriction, isMeasured, jointGaps, styles } from './scene/colouring';
import { ContactsView } from './scene/contacts_view';
import { EllipsoidsView } from './scene/ellipsoids_view';
import { FramesView } from './scene/frames_view';
import { FullGhost } from './scene/full_ghost';
import { Ghost } from './scene/ghost';
import { isBounded, isLevel } from './scene/planes_view';
import { Stage } from './scene/stage';
import { COLORS } from './scene/theme';
import { Visibility } from './scene/visibility';
import type { ViewOptions } from './ui/options';
import type { Frame, GhostFrame, Maps, RootInfo, SceneMessage, Shapes } from './wire/messages';

const FOLLOW_TIME = 0.1; // s in which the camera makes up for two thirds of a move

export class View {
  readonly stage: Stage;
  readonly bodies = new BodiesView();
  readonly contacts = new ContactsView();
  readonly ellipsoids = new EllipsoidsView();
  readonly anatomy = new AnatomyView();
  readonly visibility = new Visibility();
  readonly marked = new Set<number>(); // picked as interface bodies
  selected: string | null = null; // body, by name: it outlives a model that is built again
  scene: SceneMessage | null = null;
  frame: Frame | null = null;
  framesDrawn = 0;
  modelSize = 1;
  private maps: (Maps | null)[] = [];
  private solver: PoseSolver | null = null;
  private referenceSolver: PoseSolver | null = null;
  private shapes: Shapes | null = null;
  private fresh = false; // a frame that has not been drawn
  private framed = false; // camera, light and ground stand around these shapes
  private placed = false; // the camera has been placed before, and may have been moved by hand since
  private history: Frame[] = []; // newest first, of the present maps
  private shownChoice = '';
  private followed: THREE.Vector3 | null = null;
  private followedAt = 0; // ms
  private readonly pulls = new Arrows(COLORS.pull);
  private readonly frames = new FramesView();
  readonly full = new FullGhost(this.bodies.uniforms.styles);
  /** where the full simulation stands; null while it is off or has not begun */
  fullFrame: GhostFrame | null = null;
  private readonly reference = new Ghost(this.bodies.uniforms.styles, 0x7a8794);

  constructor(
    canvas: HTMLCanvasElement,
    readonly options: ViewOptions,
  ) {
    this.stage = new Stage(canvas);
    this.stage.scene.add(
      this.bodies.group,
      this.contacts.group,
      this.pulls.group,
      this.frames.lines,
      this.reference.group,
      this.full.ghost.group,
      this.ellipsoids.group,
      this.anatomy.group,
    );
  }

  private showShapes(shapes: Shapes, roots: RootInfo[]): void {
    this.shapes = shapes;
    this.shownChoice = this.choice;
    this.bodies.show(shapes, roots, this.options);
    this.stage.planes.show(this.bodies.picturedPlanes, this.bodies.uniforms.pictures);
    this.framed = false;
  }

  setFrame(scene: SceneMessage, shapes: Shapes, frame: Frame, maps: (Maps | null)[]): void {
    if (this.shapes !== shapes) {
      this.showShapes(shapes, scene.roots);
      this.scene = null;
    }
    if (this.scene !== scene) this.useScene(scene);
    if (maps.some((m, i) => m !== this.maps[i])) this.history = [];
    this.frame = frame;
    this.maps = maps;
    this.fresh = true;
    if (!this.framed) this.placeCamera();
  }

  private useScene(scene: SceneMessage): void {
    this.scene = scene;
    this.maps = [];
    this.history = [];
    this.solver?.dispose();
    this.referenceSolver?.dispose();
    this.solver = new PoseSolver(scene, this.options.copies);
    this.referenceSolver = new PoseSolver(scene);
    const columns = Math.ceil(Math.sqrt(this.options.copies));
    this.bodies.use(this.solver, columns, this.options.copies > 1 ? 0.9 * this.modelSize : 0);
    this.reference.use(this.referenceSolver, this.bodies.batches);
    this.full.use(scene, this.bodies.batches);
    if (this.fullFrame?.epoch === scene.epoch) this.full.set(this.fullFrame);
    this.style();
  }

  private get choice(): string {
    return JSON.stringify([this.options.shapes, [...this.options.hiddenGroups]]);
  }

  /** After a change of the options. */
  restyle(): void {
    if (this.scene && this.shapes) {
      const otherShapes = this.shownChoice !== this.choice;
      if (otherShapes) this.showShapes(this.shapes, this.scene.roots);
      if (otherShapes || this.solver?.copies !== this.options.copies) {
        const maps = this.maps;
        this.useScene(this.scene);
        this.maps = maps;
      }
    }
    this.stage.renderer.shadowMap.enabled = this.options.shadows;
    this.stage.setShadows(this.options.shadows);
    this.contacts.showForces = this.options.forces;
    this.contacts.showCones = this.options.cones;
    this.contacts.metresPerNewton = this.options.arrowScale / 1000;
    this.frames.lines.visible = this.options.frames;
    this.anatomy.group.visible = this.options.copies === 1;
    this.bodies.showStill(this.options.world);
    this.stage.planes.group.visible = this.options.world;
    this.ellipsoids.mesh.visible = this.options.compliance;
    // Copies stand in a field of their own; forces belong to one.
    this.contacts.group.visible = this.pulls.group.visible = this.options.copies === 1;
    this.reference.group.visible = this.options.reference;
    this.full.setOffset(this.options.ghostOffset);
    this.style();
    this.fresh = true;
  }

  style(): void {
    if (!this.scene) return;
    const { colouring } = this.options;
    const values =
      colouring === 'gaps'
        ? jointGaps(this.scene, this.poses())
        : colouring === 'error'
          ? bodyErrors(this.scene, this.frame?.signals ?? new Float32Array())
          : colouring === 'friction'
            ? bodyFriction(this.scene, this.frame?.contacts ?? [])
            : new Float64Array();
    const { scene, selected } = this;
    const marked = new Set(this.marked);
    if (selected !== null) scene.bodies.forEach((body, b) => body.name === selected && marked.add(b));
    this.bodies.setStyles(styles(scene, colouring, values, colouring === 'friction' ? 1 : this.fullGap, marked, (b) => this.shareOf(b)));
  }

  private shareOf(body: number): number {
    return this.visibility.of(this.scene?.bodies[body]?.name ?? '');
  }

  /** The gap [m] that is drawn hottest: a hundredth of the model. */
  get fullGap(): number {
    return 0.01 * this.modelSize;
  }

  /** How many shapes the present model has, drawn or not. */
  get numShapes(): number {
    return this.shapes?.geometry.shapes.length ?? 0;
  }

  /** Poses of all bodies in the present frame, in double precision. */
  poses(): Rigid[] {
    return this.scene && this.frame && this.maps.length > 0 ? bodyPoses(this.scene, this.frame, this.maps) : [];
  }

  /** The same by the recovery mode that the simulation does not take; null: it cannot be told. */
  otherPoses(): Rigid[] | null {
    return this.scene && this.frame && this.maps.length > 0 ? otherPoses(this.scene, this.frame, this.maps) : null;
  }

  /** Puts the whole of a motion in view: frames with the maps they need. */
  frameMotion(moments: { frame: Frame; maps: (Maps | null)[] }[]): void {
    const scene = this.scene;
    if (!scene) return;
    const box = new THREE.Box3();
    for (const { frame, maps } of moments) box.union(this.bodies.box(scene, bodyPoses(scene, frame, maps)));
    this.placeCamera(box);
    this.options.follow = false;
  }

  private placeCamera(around?: THREE.Box3): void {
    if (!this.scene) return;
    const box = around ?? this.bodies.box(this.scene, this.poses());
    // A ramp or a patch is no ground where there is a level plane without end.
    const level = this.bodies.planes.filter((p) => p.body < 0 && isLevel(p));
    const endless = level.filter((p) => !isBounded(p));
    const planes = (endless.length > 0 ? endless : level).map((p) => p.pose[2]);
    const below = planes.filter((z) => z <= box.max.z && z > box.min.z - 1.5 * box.getSize(new THREE.Vector3()).length());
    const size = box.getSize(new THREE.Vector3()).length();
    // Other shapes of much the same size are looked at from where the user looks now.
    const stay = !around && this.placed && size > 0.5 * this.modelSize && size < 2 * this.modelSize;
    this.stage.frame(box, below.length > 0 ? Math.max(...below) : box.min.z, stay);
    this.modelSize = size;
    this.framed = this.placed = true;
    this.followed = null;
  }

  /** The camera goes along with the first base that can move, softly: it should not shake with it. */
  private followBase(frame: Frame): void {
    const at = this.scene?.roots.findIndex((r) => r.base === 'floating' || r.base === 'driven') ?? -1;
    const pose = frame.roots[at]?.pose;
    if (!this.options.follow || !pose) {
      this.followed = null;
      return;
    }
    const now = new THREE.Vector3(pose[0], pose[1], pose[2]);
    this.followed ??= now.clone();
    const elapsed = (performance.now() - this.followedAt) / 1000;
    this.followedAt += 1000 * elapsed;
    const shift = now.sub(this.followed).multiplyScalar(1 - Math.exp(-elapsed / FOLLOW_TIME));
    this.stage.follow(shift);
    this.followed.add(shift);
  }

  /** The full simulation beside the present scene; null: none. */
  setFull(frame: GhostFrame | null): void {
    this.fullFrame = frame;
    if (frame && frame.epoch === this.scene?.epoch) this.full.set(frame);
  }

  /** It is drawn beside the scene that it began with, where that is the one shown. */
  get fullShown(): boolean {
    return this.fullFrame !== null && this.fullFrame.epoch === this.frame?.epoch && this.options.copies === 1;
  }

  /** Computes and draws; returns whether there was a new frame. */
  draw(): boolean {
    const { frame, scene, solver } = this;
    const fresh = this.fresh && frame !== null && scene !== null && solver !== null && this.maps.length > 0;
    if (fresh) {
      this.fresh = false;
      this.solve(frame, solver);
      this.followBase(frame);
      this.contacts.update(scene, frame, this.modelSize);
      this.showPulls(frame);
      if (isMeasured(this.options.colouring)) this.style();
      if (this.options.compliance) this.ellipsoids.update(scene, frame, this.maps, this.poses(), this.modelSize);
      this.anatomy.update(scene, frame, this.maps, this.anatomyPoses(), this.modelSize, this.options, (b) => this.shareOf(b) > 0);
      if (this.options.frames) this.frames.update(this.poses(), 0.05 * this.modelSize);
    }
    this.full.ghost.group.visible = this.fullShown;
    this.stage.render();
    ++this.framesDrawn;
    return fresh;
  }

  /** Poses on the processor cost time: only where something is drawn by them. */
  private anatomyPoses(): Rigid[] {
    const { axes, centers, inertia, tendons } = this.options;
    return axes || centers || inertia || tendons ? this.poses() : [];
  }

  private solve(frame: Frame, solver: PoseSolver): void {
    const renderer = this.stage.renderer;
    solver.set(frame, this.maps);
    if (solver.copies > 1) {
      // Copy i shows the mechanism i frames ago: as many states as there are copies, in one draw.
      this.history.unshift(frame);
      this.history.length = Math.min(this.history.length, solver.copies);
      for (let i = 1; i < solver.copies; ++i)
        solver.set(this.history[i % this.history.length] ?? frame, this.maps, i);
    }
    solver.solve(renderer);
    if (!this.options.reference || !this.referenceSolver) return;
    const still = frame.roots.map((r) => ({
      ...r,
      z: new Float32Array(r.z.length),
      correction: new Float32Array(r.correction.length),
    }));
    this.referenceSolver.set({ ...frame, roots: still }, this.maps);
    this.referenceSolver.solve(renderer);
  }

  private showPulls(frame: Frame): void {
    this.pulls.begin(frame.pulls.length);
    for (const p of frame.pulls) {
      const stretch: [number, number, number] = [
        p.target[0] - p.point[0],
        p.target[1] - p.point[1],
        p.target[2] - p.point[2],
      ];
      // A push has no target: it is drawn along its force.
      const force = Math.hypot(...p.force);
      const shown = Math.hypot(...stretch) > 0 ? stretch : scaled(p.force, (0.12 * this.modelSize) / (force || 1));
      this.pulls.add(p.point, shown, 0.0028 * this.modelSize);
    }
    this.pulls.end();
  }

  /** Largest distance [m] between a body on the GPU and in the reference, for the present frame. */
  poseError(): number {
    if (this.fresh) this.draw();
    const gpu = this.solver?.read(this.stage.renderer) ?? new Float32Array();
    return Math.max(
      0,
      ...this.poses().map((X, b) =>
        Math.hypot(X.p[0] - (gpu[7 * b] ?? NaN), X.p[1] - (gpu[7 * b + 1] ?? NaN), X.p[2] - (gpu[7 * b + 2] ?? NaN)),
      ),
    );
  }

  /** Where a point of a body lies on the page, in pixels of an area of this size, and is drawn and can be clicked. */
  screenOf(body: number, point: readonly [number, number, number], width: number, height: number): { x: number; y: number } {
    if (this.fresh) this.draw();
    const X = this.poses()[body];
    const at = new THREE.Vector3(...(X ? apply(X, [...point]) : point)).project(this.stage.camera);
    return { x: (0.5 + 0.5 * at.x) * width, y: (0.5 - 0.5 * at.y) * height };
  }
}

function scaled(v: readonly [number, number, number], s: number): [number, number, number] {
  return [v[0] * s, v[1] * s, v[2] * s];
}
