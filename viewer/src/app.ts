// The page: what comes in is drawn, what the user does goes out.
import * as THREE from 'three';
import { LiveStream, type Request } from './net/live';
import { PoseSolver } from './poses/gpu';
import { bodyPoses } from './poses/reference';
import { apply, type Rigid } from './poses/rigid';
import { Arrows } from './scene/arrows';
import { BodiesView } from './scene/bodies_view';
import { Stage } from './scene/stage';
import { COLORS, DARK, LIGHT } from './scene/theme';
import { Bar } from './ui/bar';
import { element, withUnit } from './ui/dom';
import { Notices } from './ui/notices';
import { Pointer } from './ui/pointer';
import { decodeBinary } from './wire/decode';
import { Library } from './wire/library';
import type { Frame, GeometryMessage, Maps, MeshData, SceneMessage, TextMessage } from './wire/messages';

export class App {
  readonly stage: Stage;
  readonly bodies = new BodiesView();
  readonly library = new Library();
  solver: PoseSolver | null = null;
  scene: SceneMessage | null = null;
  frame: Frame | null = null;
  framesDrawn = 0;
  framesTaken = 0;
  private maps: (Maps | null)[] = [];
  private geometry: GeometryMessage | null = null;
  private meshes: MeshData[] = [];
  private fresh = false; // a frame that has not been drawn
  private framed = false; // the camera has been placed
  private dark = window.matchMedia('(prefers-color-scheme: dark)').matches;
  private readonly bar: Bar;
  private readonly notices: Notices;
  private readonly pointer: Pointer;
  private readonly contacts = new Arrows(COLORS.contact);
  private readonly pulls = new Arrows(COLORS.pull);
  private readonly forceLabel: HTMLElement;
  private live: LiveStream | null = null;
  private modelSize = 1;

  constructor(private readonly root: HTMLElement) {
    const canvas = element('canvas', 'stage', root);
    canvas.tabIndex = 0;
    canvas.setAttribute('aria-label', 'The mechanism; drag a body to pull it, click to push it');
    this.notices = new Notices(root);
    this.stage = new Stage(canvas);
    this.stage.scene.add(this.bodies.group, this.contacts.group, this.pulls.group);
    this.forceLabel = element('div', 'force', root);
    this.forceLabel.hidden = true;
    this.bar = new Bar(root, {
      pause: () => this.togglePause(),
      step: () => this.send({ type: 'step' }),
      reset: () => this.send({ type: 'reset' }),
      home: () => this.stage.goHome(),
      theme: () => this.setDark(!this.dark),
    });
    this.pointer = new Pointer(canvas, this.stage, this.bodies, {
      canTouch: () => this.live !== null,
      picking: () => false,
      pull: (body, point, target) =>
        this.send({ type: 'pull', body, point: point.toArray(), target: target.toArray() }),
      release: () => this.send({ type: 'release' }),
      push: (body, point, direction) =>
        this.send({ type: 'push', body, point: point.toArray(), target: direction.toArray() }),
      choose: () => undefined,
      hover: () => undefined,
      worldPoint: (body, point) => {
        const X = this.poses()[body];
        return X ? new THREE.Vector3(...apply(X, point.toArray())) : point.clone();
      },
    });
    this.setDark(this.dark);
    window.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(root);
    this.resize();
    this.stage.renderer.setAnimationLoop(() => this.draw());
  }

  connect(url: string): void {
    this.notices.coverWith('Connecting', 'Waiting for the simulation.');
    this.live = new LiveStream(url, {
      opened: () => {
        this.library.clear();
        this.scene = null;
      },
      message: (data) => this.take(data),
      closed: (reason) => {
        this.bar.setEnabled(false);
        if (reason) this.notices.say(`The program closed the connection: ${reason}`);
        this.notices.coverWith('No connection', 'The simulation does not answer. This page tries again by itself.');
      },
    });
    this.live.start();
  }

  send(request: Request): void {
    this.live?.send(request);
  }

  take(data: string | ArrayBuffer): void {
    if (typeof data === 'string') {
      this.takeText(JSON.parse(data) as TextMessage);
      return;
    }
    const message = decodeBinary(data);
    if (message.kind === 'meshes') {
      this.meshes = message.meshes;
      this.showShapes();
    } else if (message.kind === 'maps') {
      this.library.addMaps(message.maps);
    } else {
      this.takeFrame(message.frame);
    }
  }

  private takeText(message: TextMessage): void {
    switch (message.type) {
      case 'geometry':
        this.geometry = message;
        this.meshes = [];
        if (message.meshes === 0) this.showShapes();
        break;
      case 'scene':
        this.library.addScene(message);
        break;
      case 'notice':
        this.notices.say(message.message);
        break;
      case 'error':
        this.notices.coverWith('The model cannot be shown', message.message);
        break;
      case 'settings':
        break;
    }
  }

  private takeFrame(frame: Frame): void {
    const maps = this.library.mapsOf(frame);
    const scene = this.library.scene(frame.epoch);
    if (!maps || !scene) return; // what it refers to is still on its way
    if (this.scene !== scene) this.useScene(scene);
    this.frame = frame;
    this.maps = maps;
    this.fresh = true;
    ++this.framesTaken;
    this.library.keepOnly(frame);
    this.notices.uncover();
    this.bar.setEnabled(this.live !== null);
    if (!this.framed) this.placeCamera();
  }

  private useScene(scene: SceneMessage): void {
    this.scene = scene;
    this.solver?.dispose();
    this.solver = new PoseSolver(scene);
    this.bodies.use(this.solver);
    this.bar.setTitle(scene.title);
    this.style();
  }

  private showShapes(): void {
    if (!this.geometry) return;
    this.bodies.show(this.geometry, this.meshes, false);
    if (this.solver) this.bodies.use(this.solver);
    this.style();
    this.framed = false;
  }

  private style(): void {
    if (!this.scene) return;
    const styles = new Float32Array(4 * Math.max(1, this.scene.bodies.length));
    const tone = new THREE.Color();
    this.scene.bodies.forEach((body, b) => {
      tone.set(body.interface ? COLORS.interface : COLORS.interior);
      styles.set([tone.r, tone.g, tone.b, body.interface ? 0.85 : 0], 4 * b);
    });
    this.bodies.setStyles(styles);
  }

  /** Poses of all bodies in the present frame, in double precision. */
  poses(): Rigid[] {
    return this.scene && this.frame ? bodyPoses(this.scene, this.frame, this.maps) : [];
  }

  /** Largest distance [m] between a body on the GPU and in the reference, for the frame last drawn. */
  poseError(): number {
    if (!this.solver || !this.frame || this.fresh) this.draw();
    const gpu = this.solver?.read(this.stage.renderer) ?? new Float32Array();
    return Math.max(
      0,
      ...this.poses().map((X, b) =>
        Math.hypot(X.p[0] - (gpu[7 * b] ?? NaN), X.p[1] - (gpu[7 * b + 1] ?? NaN), X.p[2] - (gpu[7 * b + 2] ?? NaN)),
      ),
    );
  }

  /** Where a point of a body lies on the page, in pixels. */
  screenOf(body: number, point: readonly [number, number, number] = [0, 0, 0]): { x: number; y: number } {
    const X = this.poses()[body];
    const at = new THREE.Vector3(...(X ? apply(X, [...point]) : point)).project(this.stage.camera);
    return { x: (0.5 + 0.5 * at.x) * this.root.clientWidth, y: (0.5 - 0.5 * at.y) * this.root.clientHeight };
  }

  private placeCamera(): void {
    if (!this.scene || !this.frame || !this.geometry) return;
    if (this.geometry.meshes > 0 && this.meshes.length === 0) return;
    const box = this.bodies.box(this.scene, this.poses());
    const planes = this.bodies.planes.filter((p) => p.body < 0).map((p) => p.pose[2]);
    this.stage.frame(box, planes.length > 0 ? Math.max(...planes) : box.min.z);
    this.modelSize = box.getSize(new THREE.Vector3()).length();
    this.framed = true;
  }

  private draw(): void {
    if (this.fresh && this.solver && this.frame) {
      this.fresh = false;
      this.solver.set(this.frame, this.maps);
      this.solver.solve(this.stage.renderer);
      this.showForces(this.frame);
      this.showState(this.frame);
    }
    this.pointer.update();
    this.placeForceLabel();
    this.stage.render();
    ++this.framesDrawn;
  }

  private showForces(frame: Frame): void {
    const width = 0.004 * this.modelSize;
    const largest = Math.max(1e-9, ...frame.contacts.map((c) => Math.hypot(...c.force)));
    const scale = (0.16 * this.modelSize) / largest;
    this.contacts.begin();
    for (const c of frame.contacts) {
      const sign = c.b < 0 ? -1 : 1; // on the body that moves, if only one does
      this.contacts.add(c.point, [sign * scale * c.force[0], sign * scale * c.force[1], sign * scale * c.force[2]], width);
    }
    this.contacts.end();
    this.pulls.begin();
    for (const p of frame.pulls)
      this.pulls.add(
        p.point,
        [p.target[0] - p.point[0], p.target[1] - p.point[1], p.target[2] - p.point[2]],
        0.6 * width,
      );
    this.pulls.end();
  }

  private placeForceLabel(): void {
    const pull = this.frame?.pulls[0];
    this.forceLabel.hidden = !pull;
    if (!pull) return;
    const at = new THREE.Vector3(...pull.target).project(this.stage.camera);
    this.forceLabel.style.left = `${(0.5 + 0.5 * at.x) * this.root.clientWidth}px`;
    this.forceLabel.style.top = `${(0.5 - 0.5 * at.y) * this.root.clientHeight}px`;
    this.forceLabel.textContent = withUnit(Math.hypot(...pull.force), 'N');
  }

  scalar(name: string): number {
    const at = this.scene?.scalars.indexOf(name) ?? -1;
    return at < 0 ? NaN : (this.frame?.scalars[at] ?? NaN);
  }

  private showState(frame: Frame): void {
    const factor = this.scalar('real_time_factor');
    const parts = [
      `${this.scalar('time').toFixed(2)} s`,
      frame.paused ? 'paused' : `${factor.toFixed(2)} × real time`,
      `${this.scalar('step_us').toFixed(0)} µs a step`,
    ];
    this.bar.setState(parts.join('  ·  '));
    this.bar.setPaused(frame.paused);
  }

  private togglePause(): void {
    if (this.frame) this.send({ type: 'pause', on: !this.frame.paused });
  }

  private setDark(dark: boolean): void {
    this.dark = dark;
    document.documentElement.dataset['theme'] = dark ? 'dark' : 'light';
    this.stage.setTheme(dark ? DARK : LIGHT);
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
    switch (event.key) {
      case ' ':
        this.togglePause();
        break;
      case 'ArrowRight':
        this.send({ type: 'step' });
        break;
      case 'Backspace':
        this.send({ type: 'reset' });
        break;
      case 'f':
        this.stage.goHome();
        break;
      case 't':
        this.setDark(!this.dark);
        break;
      default:
        return;
    }
    event.preventDefault();
  }

  private resize(): void {
    this.stage.resize(this.root.clientWidth, this.root.clientHeight);
  }
}
