// Recordings shown in place of the running simulation: made in the page, of the last minute, or from disk.
import type { Request } from '../net/live';
import { otherPoses } from '../poses/other_recovery';
import { bodyPoses } from '../poses/reference';
import type { SignalStore } from '../signals/store';
import { saveFile } from '../ui/dom';
import type { View } from '../view';
import { Library } from '../wire/library';
import type { Frame } from '../wire/messages';
import { Log, replayPage, type RawMessage } from './log';
import { Timeline } from './timeline';

const READ_MS = 20; // of reading signals at a time

export interface PlayerActions {
  show(frame: Frame, library: Library): void;
  say(sentence: string): void;
  send(request: Request): void;
  keep(sequence: number): void;
  /** It began, or ended. */
  changed(playing: boolean): void;
}

export class Player {
  timeline: Timeline | null = null;
  private shown: Frame | null = null;

  constructor(
    private readonly root: HTMLElement,
    private readonly view: View,
    private readonly actions: PlayerActions,
  ) {}

  /** `live`: a running simulation is behind the page. `past`: these are its own last frames. */
  play(messages: RawMessage[], live: boolean, past = false): boolean {
    const library = new Library();
    const log = new Log(messages, library);
    if (log.moments.length === 0) {
      this.actions.say('The recording holds no frame.');
      return false;
    }
    this.view.setFull(null);
    this.timeline?.remove();
    this.timeline = new Timeline(this.root, log, {
      show: (index) => {
        this.shown = log.frameAt(index);
        if (this.shown) this.actions.show(this.shown, library);
      },
      ...(live ? { live: () => this.end(), save: () => void this.save(messages) } : {}),
      ...(live && past ? { resume: () => this.resume(), keep: () => this.shown && this.actions.keep(this.shown.sequence) } : {}),
    });
    if (past) this.timeline.goToEnd();
    else this.timeline.go(0);
    this.actions.changed(true);
    if (live) return true;
    this.readSignals = (store) => void this.fill(store, log, library);
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
    return true;
  }

  /** Puts the whole motion of a recording from disk in view, or one moment of it. */
  frameRecording: (only?: number) => void = () => undefined;

  /** Reads the signals of a recording from disk. */
  readSignals: (store: SignalStore) => void = () => undefined;

  /** Some frames at a time, so that the page goes on meanwhile. */
  private async fill(store: SignalStore, log: Log, library: Library): Promise<void> {
    this.readSignals = () => undefined;
    store.onlyKnown = true;
    let begun = performance.now();
    for (let i = 0; i < log.moments.length; ++i) {
      const frame = log.frameAt(i);
      const scene = library.scene(frame?.epoch ?? -1);
      const maps = frame && library.mapsOf(frame);
      if (!frame || !scene || !maps) continue;
      store.add(scene, frame, { own: bodyPoses(scene, frame, maps), other: otherPoses(scene, frame, maps) });
      if (performance.now() - begun < READ_MS) continue;
      await new Promise((done) => setTimeout(done));
      begun = performance.now();
    }
  }

  private resume(): void {
    if (this.shown) this.actions.send({ type: 'resume', sequence: this.shown.sequence });
    this.end();
    this.actions.send({ type: 'pause', on: false });
  }

  end(): void {
    this.timeline?.remove();
    this.timeline = null;
    this.actions.changed(false);
  }

  private async save(messages: RawMessage[]): Promise<void> {
    const page = await (await fetch('/' + location.search)).text();
    saveFile('fork1s-replay.html', replayPage(page, messages), 'text/html');
  }
}
