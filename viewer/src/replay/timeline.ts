// Scrubbing and playing a recording.
import { element, iconButton, setIcon } from '../ui/dom';
import type { Log } from './log';

export interface TimelineActions {
  show(index: number): void;
  /** Back to the running simulation; absent in a file from disk. */
  live?: () => void;
  /** Save as a file; absent in a file from disk. */
  save?: () => void;
  /** Goes on from the moment shown; absent in a file from disk. */
  resume?: () => void;
  /** Keeps the moment shown. */
  keep?: () => void;
}

const FRAME = 1 / 60; // s

export class Timeline {
  readonly root: HTMLElement;
  playing = true;
  private index = 0;
  private clock = 0; // s of play since the frame shown
  private readonly slider: HTMLInputElement;
  private readonly label: HTMLElement;
  private readonly playButton: HTMLButtonElement;

  constructor(
    parent: HTMLElement,
    private readonly log: Log,
    private readonly actions: TimelineActions,
  ) {
    this.root = element('div', 'timeline box', parent);
    const bar = element('div', 'bar', this.root);
    this.playButton = iconButton('pause', 'Pause (space)', bar, () => this.toggle());
    iconButton('step', 'One frame (right arrow)', bar, () => this.step(1));
    this.slider = element('input', '', this.root);
    this.slider.type = 'range';
    this.slider.min = '0';
    this.slider.max = String(Math.max(0, log.moments.length - 1));
    this.slider.setAttribute('aria-label', 'Time');
    this.root.setAttribute('role', 'group');
    this.root.setAttribute('aria-label', 'Recording');
    this.slider.addEventListener('input', () => {
      this.setPlaying(false);
      this.go(Number(this.slider.value));
    });
    this.label = element('span', '', this.root);
    const { live, save, resume, keep } = actions;
    const word = (text: string, title: string, act: () => void): void => {
      const button = element('button', 'text', element('div', 'bar', this.root));
      button.type = 'button';
      button.textContent = text;
      button.title = title;
      button.addEventListener('click', act);
    };
    if (resume) word('Resume here', 'The simulation goes on from this moment', resume);
    if (keep) word('Keep', 'This moment as a keyframe', keep);
    if (save) iconButton('save', 'Save as one HTML file', element('div', 'bar', this.root), save);
    if (live) word('Live', 'Back to the running simulation', live);
  }

  get at(): number {
    return this.index;
  }

  /** The moment nearest to `seconds` after the start. */
  indexAt(seconds: number): number {
    const { moments, start } = this.log;
    let best = 0;
    moments.forEach((m, i) => {
      const off = Math.abs(m.time - start - seconds);
      if (off < Math.abs((moments[best]?.time ?? Infinity) - start - seconds)) best = i;
    });
    return best;
  }

  get length(): number {
    return this.log.moments.length;
  }

  /** Seconds from the first moment to the last. */
  get duration(): number {
    const { moments, start } = this.log;
    return (moments[moments.length - 1]?.time ?? start) - start;
  }

  private setPlaying(playing: boolean): void {
    this.playing = playing;
    setIcon(this.playButton, playing ? 'pause' : 'play', playing ? 'Pause (space)' : 'Play (space)');
  }

  /** The last moment, held. */
  goToEnd(): void {
    this.setPlaying(false);
    this.go(this.length - 1);
  }

  toggle(): void {
    if (!this.playing && this.index >= this.log.moments.length - 1) this.go(0);
    this.setPlaying(!this.playing);
  }

  step(by: number): void {
    this.setPlaying(false);
    this.go(this.index + by);
  }

  rewind(): void {
    this.go(0);
  }

  go(index: number): void {
    this.index = Math.min(this.log.moments.length - 1, Math.max(0, index));
    this.clock = 0;
    this.slider.value = String(this.index);
    const time = (this.log.moments[this.index]?.time ?? 0) - this.log.start;
    this.label.textContent = `${time.toFixed(2)} / ${(this.log.end - this.log.start).toFixed(2)} s`;
    this.actions.show(this.index);
  }

  /** Moves on by `seconds` of wall time; frames of a recording are 1/60 s apart. At the end it starts again. */
  advance(seconds: number): void {
    if (!this.playing || this.log.moments.length < 2) return;
    this.clock += seconds;
    const frames = Math.floor(this.clock / FRAME);
    if (frames === 0) return;
    const rest = this.clock - frames * FRAME;
    const next = this.index + frames;
    this.go(next >= this.log.moments.length ? 0 : next);
    this.clock = rest;
  }

  remove(): void {
    this.root.remove();
  }
}
