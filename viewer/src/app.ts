// The page: what comes in is drawn, what the user does goes out.
import * as THREE from 'three';
import { LiveStream, type Request } from './net/live';
import { apply } from './poses/rigid';
import { replayPage, Log, type RawMessage } from './replay/log';
import { StreamRecorder } from './replay/recorder';
import { Timeline } from './replay/timeline';
import { Bar, ghostText } from './ui/bar';
import { element, saveFile, withUnit } from './ui/dom';
import { Help } from './ui/help';
import { bindKeys } from './ui/keys';
import { Legend } from './ui/legend';
import { Notices } from './ui/notices';
import { defaultOptions } from './ui/options';
import { Panel } from './ui/panel';
import { Picking } from './ui/picking';
import { Plots } from './ui/plots';
import { Pointer } from './ui/pointer';
import { ModelTree } from './ui/model_tree';
import { Problems } from './ui/problems';
import { SidePanel } from './ui/side_panel';
import type { Colouring } from './scene/colouring';
import { DARK, LIGHT } from './scene/theme';
import { View } from './view';
import { decodeBinary } from './wire/decode';
import { Library } from './wire/library';
import { WIRE_VERSION, type Frame, type TextMessage } from './wire/messages';

export class App {
  readonly view: View;
  readonly recorder = new StreamRecorder();
  timeline: Timeline | null = null;
  framesTaken = 0;
  private library = new Library();
  private recorded: RawMessage[] = [];
  private dark = window.matchMedia('(prefers-color-scheme: dark)').matches;
  private drawnAt = 0;
  private tipStart: THREE.Vector3 | null = null;
  private live: LiveStream | null = null;
  private ghostOn = false;
  private foreign = false; // the program speaks another version of the stream
  private readonly bar: Bar;
  private readonly notices: Notices;
  private readonly problems: Problems;
  private readonly pointer: Pointer;
  private readonly panel: Panel;
  private readonly plots: Plots;
  private readonly picking: Picking;
  private readonly legend: Legend;
  private readonly help: Help;
  private readonly side: SidePanel;
  readonly tree: ModelTree;
  private readonly forceLabel: HTMLElement;

  constructor(
    private readonly root: HTMLElement,
    colouring: Colouring = 'tips',
  ) {
    const canvas = element('canvas', 'stage', root);
    canvas.tabIndex = 0;
    canvas.setAttribute('aria-label', 'The mechanism; drag a body to pull it, click to push it');
    this.view = new View(canvas, defaultOptions(colouring));
    this.forceLabel = element('div', 'force', root);
    this.forceLabel.hidden = true;
    this.bar = new Bar(root, {
      pause: () => this.togglePause(),
      step: () => this.stepOnce(),
      reset: () => this.reset(),
      home: () => this.view.stage.goHome(),
      theme: () => this.setDark(!this.dark),
      record: () => this.toggleRecording(),
      plots: () => this.togglePlots(),
      pick: () => this.picking.toggle(),
      side: () => this.side.toggle(),
      help: () => this.help.toggle(),
    });
    // In the order in which the Tab key goes through them.
    this.side = new SidePanel(root, (open) => {
      this.bar.setSide(open);
      if (open && this.isNarrow) this.panel.close();
    });
    this.tree = new ModelTree(this.side.add('model', 'Model'), this.view, () => undefined);
    const messages = element('div', 'messages', root);
    this.notices = new Notices(root, messages);
    this.problems = new Problems(messages);
    this.legend = new Legend(root);
    this.panel = new Panel(root, this.view.options, {
      send: (request) => this.send(request),
      changed: () => this.view.restyle(),
      opened: () => this.isNarrow && this.side.close(),
    });
    this.plots = new Plots(root, saveFile);
    this.help = new Help(root);
    this.picking = new Picking(root, this.view, {
      send: (request) => this.send(request),
      changed: (on) => {
        this.bar.setPicking(on);
        canvas.classList.toggle('picking', on);
      },
    });
    this.pointer = new Pointer(canvas, this.view.stage, this.view.bodies, {
      canTouch: () => this.live !== null && this.timeline === null && this.view.options.copies === 1,
      picking: () => this.picking.on,
      selecting: () => this.side.shown === 'model' || this.side.shown === 'tune',
      select: (body) => this.tree.choose(body),
      pull: (body, point, target) =>
        this.send({ type: 'pull', body, point: point.toArray(), target: target.toArray() }),
      release: () => this.send({ type: 'release' }),
      push: (body, point, direction) =>
        this.send({ type: 'push', body, point: point.toArray(), target: direction.toArray() }),
      choose: (body) => this.picking.choose(body),
      hover: (body) => this.legend.hover(this.view.scene?.bodies[body]),
      worldPoint: (body, point) => {
        const X = this.view.poses()[body];
        return X ? new THREE.Vector3(...apply(X, point.toArray())) : point.clone();
      },
    });
    this.recorder.onFull = () => {
      this.notices.say('The recording is ten minutes long and ends here.');
      this.toggleRecording();
    };
    this.setDark(this.dark);
    this.view.restyle();
    if (root.clientWidth < 900) this.panel.close();
    bindKeys(this.keys);
    new ResizeObserver(() => this.resize()).observe(root);
    this.resize();
    this.view.stage.renderer.setAnimationLoop((now) => this.draw(now));
  }

  /** Shows a running simulation. */
  connect(url: string): void {
    this.notices.coverWith('Connecting', 'Waiting for the simulation.');
    this.live = new LiveStream(url, {
      opened: () => {
        this.foreign = false;
        this.library.clear();
        this.problems.clearAll();
      },
      message: (data) => this.take(data),
      closed: (reason) => {
        this.bar.setEnabled(false);
        this.panel.setEnabled(false);
        if (reason) this.notices.say(`The program closed the connection: ${reason}`);
        if (!this.timeline)
          this.notices.coverWith('No connection', 'The simulation does not answer. This page tries again by itself.');
      },
    });
    this.live.start();
  }

  /** Plays a recording; without a stream behind it this is all the page does. */
  play(messages: RawMessage[]): void {
    const library = new Library();
    const log = new Log(messages, library);
    if (log.moments.length === 0) {
      this.notices.say('The recording holds no frame.');
      return;
    }
    this.recorded = messages;
    this.view.setFull(null);
    this.timeline?.remove();
    this.timeline = new Timeline(this.root, log, {
      show: (index) => {
        const frame = log.frameAt(index);
        if (frame) this.show(frame, library);
      },
      ...(this.live ? { live: () => this.backToLive(), save: () => void this.saveReplay() } : {}),
    });
    this.notices.uncover();
    this.root.classList.add('with-timeline');
    this.bar.setReplay(true, this.live !== null);
    if (this.live) {
      this.panel.setEnabled(false);
      return;
    }
    this.panel.hideModel();
    this.frameRecording = (only?: number) => {
      const last = log.moments.length - 1;
      const all = Array.from({ length: 24 }, (_, i) => Math.round((i / 23) * last));
      const sample = (only === undefined ? all : [only]).map((i) => log.frameAt(i));
      this.view.frameMotion(
        sample.flatMap((frame) => {
          const maps = frame ? library.mapsOf(frame) : undefined;
          return frame && maps ? [{ frame, maps }] : [];
        }),
      );
    };
    this.frameRecording();
  }

  /** Puts the whole motion of a recording from disk in view, or one moment of it. */
  frameRecording: (only?: number) => void = () => undefined;

  private backToLive(): void {
    this.timeline?.remove();
    this.timeline = null;
    this.root.classList.remove('with-timeline');
    this.bar.setReplay(false, true);
    this.panel.setEnabled(true);
  }

  private async saveReplay(): Promise<void> {
    const page = await (await fetch('/')).text();
    saveFile('fork1s-replay.html', replayPage(page, this.recorded), 'text/html');
  }

  send(request: Request): void {
    this.live?.send(request);
  }

  /** One message of the stream. */
  take(data: RawMessage): void {
    if (this.foreign) return;
    this.recorder.take(data);
    if (typeof data === 'string') {
      this.takeText(data);
      return;
    }
    const message = decodeBinary(data);
    if (message.kind === 'meshes') this.library.addMeshes(message.meshes);
    else if (message.kind === 'maps') this.library.addMaps(message.maps);
    else if (message.kind === 'ghost') this.view.setFull(this.timeline ? null : message.ghost);
    else if (!this.timeline) {
      this.show(message.frame, this.library);
      this.library.keepOnly(message.frame);
    }
  }

  private takeText(text: string): void {
    const message = JSON.parse(text) as TextMessage;
    switch (message.type) {
      case 'geometry':
        this.library.addGeometry(message);
        break;
      case 'scene':
        this.foreign = message.version !== WIRE_VERSION;
        if (this.foreign)
          this.notices.coverWith('Load this page again', 'It was made for another version of the program that now runs.');
        else this.library.addScene(message);
        break;
      case 'settings':
        this.panel.useSettings(message);
        this.ghostOn = message.ghost;
        if (!message.ghost) this.view.setFull(null);
        break;
      case 'notice':
        this.notices.say(message.message);
        break;
      case 'problem':
        this.problems.say(message.about, message.message);
        break;
    }
  }

  private show(frame: Frame, library: Library): void {
    const maps = library.mapsOf(frame);
    const scene = library.scene(frame.epoch);
    const shapes = scene ? library.shapesOf(scene) : undefined;
    if (!maps || !scene || !shapes) return; // what it refers to is still on its way
    if (this.view.scene !== scene) {
      this.bar.setTitle(scene.title);
      this.panel.useScene(scene);
      this.picking.useScene(scene);
      this.tree.useScene(scene, shapes);
      this.tipStart = null;
      this.problems.clear('request', 'ghost'); // the model was built anew since
      if (!this.view.scene) this.notices.sayAll(scene.warnings);
    }
    if (!frame.paused) this.problems.clear('run');
    this.view.setFrame(scene, shapes, frame, maps);
    ++this.framesTaken;
    this.addSample(frame);
    this.notices.uncover();
    if (!this.timeline) {
      this.bar.setEnabled(this.live !== null);
      this.panel.setEnabled(true);
    }
  }

  private addSample(frame: Frame): void {
    const tip = this.view.scene?.bodies.findIndex((b) => b.interface) ?? -1;
    const X = this.plots.shown && tip >= 0 ? this.view.poses()[tip] : undefined;
    const at = X ? new THREE.Vector3(...X.p) : null;
    this.tipStart ??= at;
    this.plots.add({
      time: this.scalar('time'),
      values: [
        this.scalar('real_time_factor'),
        this.scalar('step_us'),
        frame.contacts.reduce((sum, c) => sum + Math.hypot(...c.force), 0),
        this.scalar('kinetic_energy') + this.scalar('potential_energy'),
        1000 * this.scalar('joint_gap'),
        at && this.tipStart ? 1000 * at.distanceTo(this.tipStart) : 0,
      ],
    });
  }

  scalar(name: string): number {
    const at = this.view.scene?.scalars.indexOf(name) ?? -1;
    return at < 0 ? NaN : (this.view.frame?.scalars[at] ?? NaN);
  }

  private draw(now: number): void {
    const seconds = Math.min(0.25, (now - this.drawnAt) / 1000);
    this.drawnAt = now;
    this.timeline?.advance(seconds);
    this.pointer.update();
    if (this.view.draw()) this.showState();
    this.placeForceLabel();
    this.plots.draw(now);
  }

  private placeForceLabel(): void {
    const pull = this.view.frame?.pulls[0];
    this.forceLabel.hidden = !pull;
    if (!pull) return;
    const at = new THREE.Vector3(...pull.target).project(this.view.stage.camera);
    this.forceLabel.style.left = `${(0.5 + 0.5 * at.x) * this.root.clientWidth}px`;
    this.forceLabel.style.top = `${(0.5 - 0.5 * at.y) * this.root.clientHeight}px`;
    this.forceLabel.textContent = withUnit(Math.hypot(...pull.force), 'N');
  }

  private showState(): void {
    const { frame } = this.view;
    if (!frame) return;
    const parts = [`${this.scalar('time').toFixed(2)} s`];
    if (this.timeline) parts.push('recording');
    else {
      parts.push(frame.paused ? 'paused' : `${this.scalar('real_time_factor').toFixed(2)} × real time`);
      parts.push(`${this.scalar('step_us').toFixed(0)} µs a step`);
      const reduce = this.scalar('reduce_ms');
      if (reduce > 0) parts.push(`reduced in ${reduce.toPrecision(2)} ms`);
    }
    this.bar.setState(parts.join('  ·  '));
    this.bar.setGhost(this.ghostOn && !this.timeline ? ghostText(this.view.fullShown ? this.view.fullFrame : null, this.view.scene) : '');
    this.bar.setPaused(this.timeline ? !this.timeline.playing : frame.paused);
    this.legend.show(this.view, frame, this.scalar('load_factor'));
  }

  private togglePause(): void {
    if (this.timeline) this.timeline.toggle();
    else if (this.view.frame) this.send({ type: 'pause', on: !this.view.frame.paused });
  }

  private stepOnce(): void {
    if (this.timeline) this.timeline.step(1);
    else this.send({ type: 'step' });
  }

  private reset(): void {
    if (this.timeline) this.timeline.rewind();
    else this.send({ type: 'reset' });
  }

  private toggleRecording(): void {
    if (this.timeline || !this.live) return;
    if (this.recorder.recording) this.play(this.recorder.stop());
    else this.recorder.start();
    this.bar.setRecording(this.recorder.recording);
  }

  private togglePlots(): void {
    this.plots.toggle();
    this.root.classList.toggle('with-plots', this.plots.shown);
    this.bar.setPlots(this.plots.shown);
  }

  private setDark(dark: boolean): void {
    this.dark = dark;
    document.documentElement.dataset['theme'] = dark ? 'dark' : 'light';
    this.view.stage.setTheme(dark ? DARK : LIGHT);
    if (this.plots.shown) this.plots.build();
  }

  private readonly keys: Record<string, () => void> = {
    ' ': () => this.togglePause(),
    ArrowRight: () => this.stepOnce(),
    ArrowLeft: () => this.timeline?.step(-1),
    Backspace: () => this.reset(),
    f: () => this.view.stage.goHome(),
    t: () => this.setDark(!this.dark),
    r: () => this.toggleRecording(),
    p: () => this.togglePlots(),
    i: () => this.picking.toggle(),
    s: () => this.panel.toggle(),
    m: () => this.side.toggle('model'),
    '?': () => this.help.toggle(),
    Escape: () => {
      this.help.close();
      this.problems.clearAll();
    },
  };

  /** One panel at a time has room. */
  private get isNarrow(): boolean {
    return this.root.clientWidth <= 640;
  }

  private resize(): void {
    this.view.stage.resize(this.root.clientWidth, this.root.clientHeight);
    if (this.plots.shown) this.plots.resize();
  }

  /** Where a point of a body lies on the page, in pixels. */
  screenOf(body: number, point: readonly [number, number, number] = [0, 0, 0]): { x: number; y: number } {
    return this.view.screenOf(body, point, this.root.clientWidth, this.root.clientHeight);
  }
}
