// The page: what comes in is drawn, what the user does goes out.
import * as THREE from 'three';
import { LiveStream, type Request } from './net/live';
import { apply } from './poses/rigid';
import type { RawMessage } from './replay/log';
import { RollingPast } from './replay/past';
import { Player } from './replay/player';
import { StreamRecorder } from './replay/recorder';
import type { Timeline } from './replay/timeline';
import { SignalStore } from './signals/store';
import { Bar, ghostText } from './ui/bar';
import { element, saveFile } from './ui/dom';
import { ForceLabel } from './ui/force_label';
import { HoverLabel } from './ui/hover_label';
import { findFreeArea } from './ui/free_area';
import { Help } from './ui/help';
import { bindKeys, isTextField } from './ui/keys';
import { Legend } from './ui/legend';
import { Notices } from './ui/notices';
import { defaultOptions } from './ui/options';
import { Panel } from './ui/panel';
import { Picking } from './ui/picking';
import { Plots } from './ui/plots';
import { Pointer } from './ui/pointer';
import { Problems } from './ui/problems';
import { Stretch } from './ui/stretch';
import { Workbench } from './ui/workbench';
import type { Colouring } from './scene/colouring';
import { DARK, LIGHT } from './scene/theme';
import { View } from './view';
import { decodeBinary } from './wire/decode';
import { Library } from './wire/library';
import { WIRE_VERSION, type Frame, type GhostFrame, type TextMessage } from './wire/messages';

export class App {
  readonly view: View;
  readonly recorder = new StreamRecorder();
  readonly past = new RollingPast();
  readonly store = new SignalStore();
  readonly player: Player;
  readonly bench: Workbench;
  framesTaken = 0;
  private library = new Library();
  private dark = window.matchMedia('(prefers-color-scheme: dark)').matches;
  private drawnAt = 0;
  private live: LiveStream | null = null;
  private ghostOn = false;
  private goesOn = false; // it ran when the user looked back
  private laidOut = false; // the camera shows the model where the panels leave room
  private resuming = false; // it was told to go on, and frames still come from before that
  private foreign = false; // the program speaks another version of the stream
  private readonly bar: Bar;
  private readonly notices: Notices;
  private readonly problems: Problems;
  private readonly pointer: Pointer;
  private readonly panel: Panel;
  readonly plots: Plots;
  private readonly picking: Picking;
  private readonly legend: Legend;
  private readonly help: Help;
  private readonly forceLabel: ForceLabel;
  private readonly hoverLabel: HoverLabel;

  constructor(
    private readonly root: HTMLElement,
    colouring: Colouring = 'tips',
  ) {
    const canvas = element('canvas', 'stage', root);
    canvas.tabIndex = 0;
    canvas.setAttribute('aria-label', 'The mechanism; drag a body to pull it, click to push it');
    this.view = new View(canvas, defaultOptions(colouring));
    this.forceLabel = new ForceLabel(root);
    this.hoverLabel = new HoverLabel(root);
    this.bar = new Bar(root, {
      pause: () => this.togglePause(),
      step: () => this.stepOnce(),
      reset: () => this.reset(),
      home: () => this.goHome(),
      theme: () => this.setDark(!this.dark),
      record: () => this.toggleRecording(),
      plots: () => this.showPlots(!this.plots.shown),
      pick: () => this.picking.toggle(),
      side: () => this.bench.side.toggle(),
      past: () => this.lookBack(),
      keep: () => this.bench.moment.ask(0),
      help: () => this.help.toggle(),
    });
    // In the order in which the Tab key goes through them.
    const messages = element('div', 'messages');
    this.plots = new Plots(root, this.store, saveFile);
    this.bench = new Workbench(root, messages, this.view, this.store, this.plots, {
      send: (request) => this.send(request),
      showPlots: () => this.showPlots(true),
      opened: (open) => {
        this.bar.setSide(open);
        if (this.bench.side.shown === 'signals') this.player.readSignals(this.store);
        if (open && this.isSmall) this.panel.close();
        this.layOut();
      },
    });
    root.append(messages);
    this.notices = new Notices(root, messages);
    this.problems = new Problems(messages);
    this.legend = new Legend(root);
    this.panel = new Panel(root, this.view.options, {
      send: (request) => this.send(request),
      changed: () => {
        this.view.restyle();
        this.laidOut = false; // the legend changes
      },
      opened: () => this.isSmall && this.bench.side.close(),
      colouringChanged: () => this.bench.askForSignals(),
    });
    root.append(this.plots.root);
    this.help = new Help(root);
    this.player = new Player(root, this.view, {
      show: (frame, library) => {
        this.show(frame, library);
        this.store.playhead = this.scalar('time');
      },
      say: (sentence) => this.notices.say(sentence),
      send: (request) => this.send(request),
      keep: (sequence) => this.bench.moment.ask(sequence),
      changed: (playing) => this.playerChanged(playing),
    });
    this.picking = new Picking(root, this.view, {
      send: (request) => this.send(request),
      changed: (on) => {
        this.bar.setPicking(on);
        canvas.classList.toggle('picking', on);
        this.layOut();
      },
    });
    const stretch = new Stretch(this.view.ellipsoids, this.bench.tuning.shape);
    this.pointer = new Pointer(canvas, this.view.stage, this.view.bodies, {
      canTouch: () => this.live !== null && this.timeline === null && this.view.options.copies === 1,
      picking: () => this.picking.on,
      selecting: () => this.bench.selecting,
      select: (body) => this.bench.tree.choose(body),
      stretching: () => (this.bench.side.shown === 'tune' && this.view.options.compliance ? stretch : null),
      pull: (body, point, target) =>
        this.send({ type: 'pull', body, point: point.toArray(), target: target.toArray() }),
      release: () => this.send({ type: 'release' }),
      push: (body, point, direction) =>
        this.send({ type: 'push', body, point: point.toArray(), target: direction.toArray() }),
      choose: (body) => this.picking.choose(body),
      hover: (body, x, y) => this.hoverLabel.at(body, x, y),
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
    if (this.isSmall) this.panel.close();
    bindKeys(this.keys);
    new ResizeObserver(() => this.resize()).observe(root);
    const panels = new ResizeObserver(() => this.layOut());
    for (const panel of root.querySelectorAll('.lil-gui.panel, .plots')) panels.observe(panel);
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
        this.past.clear();
        this.problems.clearAll();
        this.bench.setLive(this.timeline === null);
      },
      message: (data) => this.take(data),
      closed: (reason) => {
        this.bar.setEnabled(false);
        this.panel.setEnabled(false);
        this.bench.setLive(false);
        if (reason) this.notices.say(`The program closed the connection: ${reason}`);
        if (!this.timeline)
          this.notices.coverWith(
            'No connection',
            'The simulation does not answer. This page tries again by itself. A program that was started again has a new address.',
          );
      },
    });
    this.live.start();
  }

  /** Plays a recording; without a stream behind it this is all the page does. */
  play(messages: RawMessage[], past = false): void {
    if (!this.player.play(messages, this.live !== null, past)) return;
    if (!this.live) this.panel.hideModel();
  }

  /** The last minute, held at its end, with the simulation paused. */
  private lookBack(): void {
    if (this.timeline) {
      this.timeline.step(-1);
      return;
    }
    if (!this.live || this.past.length === 0) return;
    this.goesOn = this.resuming || this.view.frame?.paused === false;
    this.send({ type: 'pause', on: true });
    this.play(this.past.recording(), true);
  }

  private playerChanged(playing: boolean): void {
    this.root.classList.toggle('with-timeline', playing);
    if (!playing) this.store.playhead = null;
    this.bar.setReplay(playing, this.live !== null);
    this.panel.setEnabled(!playing);
    this.bench.setLive(!playing && this.live !== null);
    this.layOut();
    if (playing) this.notices.uncover();
    else if (this.goesOn) {
      this.resuming = true;
      this.send({ type: 'pause', on: false });
    }
  }

  get timeline(): Timeline | null {
    return this.player.timeline;
  }

  frameRecording(only?: number): void {
    this.player.frameRecording(only);
  }

  send(request: Request): void {
    this.live?.send(request);
  }

  /** One message of the stream. */
  take(data: RawMessage): void {
    if (this.foreign) return;
    this.recorder.take(data);
    this.past.take(data);
    if (typeof data === 'string') {
      this.takeText(data);
      return;
    }
    const message = decodeBinary(data);
    if (message.kind === 'meshes') this.library.addMeshes(message.meshes, message.pictures);
    else if (message.kind === 'maps') this.library.addMaps(message.maps);
    else if (message.kind === 'ghost') this.takeGhost(message.ghost);
    else if (!this.timeline) {
      this.show(message.frame, this.library);
      if (this.view.frame === message.frame) this.addSample(message.frame);
      this.library.keepOnly(message.frame);
    }
  }

  private takeGhost(ghost: GhostFrame): void {
    this.view.setFull(this.timeline ? null : ghost);
    const { scene } = this.view;
    if (scene?.epoch === ghost.epoch && this.plots.shows('place')) this.store.addFull(scene, ghost);
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
        this.bench.useSettings(message);
        this.ghostOn = message.ghost;
        if (!message.ghost) this.view.setFull(null);
        break;
      case 'notice':
        this.notices.say(message.message);
        break;
      case 'problem':
        this.problems.say(message.about, message.message);
        break;
      default:
        this.bench.take(message);
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
      this.bench.useScene(scene, shapes);
      this.problems.clear('request', 'ghost'); // the model was built again since
      if (!this.view.scene) this.notices.sayAll(scene.warnings);
    }
    if (!frame.paused) {
      this.problems.clear('run');
      if (!this.timeline) this.resuming = false;
    }
    this.view.setFrame(scene, shapes, frame, maps);
    ++this.framesTaken;
    this.notices.uncover();
    if (!this.timeline) {
      this.bar.setEnabled(this.live !== null);
      this.panel.setEnabled(true);
    }
  }

  private addSample(frame: Frame): void {
    const { scene } = this.view;
    // Poses on the processor cost time: only where something is drawn by them.
    const places = this.plots.shows('place') ? { own: this.view.poses(), other: this.view.otherPoses() } : null;
    if (scene) this.store.add(scene, frame, places);
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
    this.view.ellipsoids.grabbable = this.live !== null && this.bench.side.shown === 'tune';
    if (this.view.draw()) this.showState();
    this.forceLabel.place(this.view.frame, this.view.stage.camera);
    this.hoverLabel.show(this.view.scene, this.view.frame, this.bench.tuning.numbers);
    this.plots.draw(now);
    this.bench.draw(now);
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
    const error = 1000 * this.scalar('error');
    if (Number.isFinite(error)) parts.splice(1, 0, `± ${error < 0.001 ? '< 0.001' : error.toPrecision(2)} mm`);
    this.bar.setState(parts.join('  ·  '));
    this.bar.setGhost(this.ghostOn && !this.timeline ? ghostText(this.view.fullShown ? this.view.fullFrame : null, this.view.scene) : '');
    this.bar.setPaused(this.timeline ? !this.timeline.playing : frame.paused);
    this.legend.show(this.view, frame, this.scalar('load_factor'));
    if (!this.laidOut) this.layOut();
    this.laidOut = true;
  }

  private togglePause(): void {
    this.resuming = false;
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

  private showPlots(on: boolean): void {
    if (on) this.player.readSignals(this.store);
    this.plots.show(on);
    this.bench.askForSignals();
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
    ArrowLeft: () => this.lookBack(),
    Backspace: () => this.reset(),
    f: () => this.goHome(),
    t: () => this.setDark(!this.dark),
    r: () => this.toggleRecording(),
    p: () => this.showPlots(!this.plots.shown),
    i: () => this.picking.toggle(),
    s: () => this.panel.toggle(),
    m: () => this.bench.side.toggle('model'),
    u: () => this.bench.side.toggle('tune'),
    l: () => this.bench.side.toggle('signals'),
    k: () => this.live && this.bench.moment.ask(0),
    '?': () => this.help.toggle(),
    Escape: () => this.leave(),
  };

  /** Leaves one mode, that on top first. */
  private leave(): void {
    const { activeElement } = document;
    if (this.help.shown) this.help.close();
    else if (this.bench.moment.open) this.bench.moment.close();
    else if (isTextField(activeElement)) activeElement.blur();
    else if (this.picking.on) this.picking.toggle();
    else if (this.plots.shown && this.plots.zoomed) this.plots.setZoom(null);
    else if (this.recorder.recording) this.toggleRecording();
    else if (this.timeline && this.live) this.player.end();
    else this.problems.clearAll();
  }

  /** As in phone.css: one panel at a time has room. */
  private get isSmall(): boolean {
    return this.root.clientWidth < 900 || this.root.clientHeight <= 500;
  }

  private resize(): void {
    this.view.stage.resize(this.root.clientWidth, this.root.clientHeight);
    if (this.isSmall && this.bench.side.shown) this.panel.close();
    if (this.plots.shown) this.plots.resize();
    this.layOut();
  }

  private goHome(): void {
    this.layOut();
    this.view.stage.goHome();
  }

  /**
   * Shows the model where the panels leave room. After what the user does alone: were it done whenever a line of the legend
   * or of the head comes or goes, bodies would move away under the pointer.
   */
  private layOut(): void {
    const parts = this.root.querySelectorAll('.head > .title, .head > .bar, .side, .legend, .lil-gui.panel, .timeline, .pick, .plots, .problem');
    const boxes = [...parts].map((part) => part.getBoundingClientRect()).filter((box) => box.width > 0);
    this.view.stage.frameIn(findFreeArea(this.root.clientWidth, this.root.clientHeight, boxes));
  }

  /** Where a point of a body lies on the page, in pixels. */
  screenOf(body: number, point: readonly [number, number, number] = [0, 0, 0]): { x: number; y: number } {
    return this.view.screenOf(body, point, this.root.clientWidth, this.root.clientHeight);
  }
}
