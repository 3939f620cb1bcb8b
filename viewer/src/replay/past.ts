// The last minute of the stream, kept all the time: what a recording of it must begin with, then its messages.
import { decodeBinary } from '../wire/decode';
import type { TextMessage } from '../wire/messages';
import type { RawMessage } from './log';

/** A minute, or less where frames are large. */
const MOST_FRAMES = 3600;
const MOST_BYTES = 64 << 20;

/** What frames need, as it stands before the first kept one. */
class Head {
  geometry: RawMessage | null = null;
  meshes: RawMessage | null = null;
  scene: RawMessage | null = null;
  readonly maps = new Map<number, RawMessage>(); // newest of each root

  take(message: RawMessage): void {
    if (typeof message === 'string') {
      const { type } = JSON.parse(message) as TextMessage;
      if (type === 'geometry') {
        this.geometry = message;
        this.meshes = null;
      } else {
        this.scene = message;
        this.maps.clear();
      }
      return;
    }
    const binary = decodeBinary(message);
    if (binary.kind === 'meshes') this.meshes = message;
    if (binary.kind === 'maps') this.maps.set(binary.maps.root, message);
  }

  get messages(): RawMessage[] {
    return [this.geometry, this.meshes, this.scene, ...this.maps.values()].filter((m) => m !== null);
  }
}

export class RollingPast {
  private head = new Head();
  private messages: RawMessage[] = [];
  private first = 0; // of the messages that is kept; those before are cut off now and then
  private frames = 0;
  private bytes = 0;
  private time = NaN; // s, of the last frame

  private static isFrame(message: RawMessage): boolean {
    return typeof message !== 'string' && new DataView(message).getUint32(0, true) === 2;
  }
  private static size(message: RawMessage): number {
    return typeof message === 'string' ? 2 * message.length : message.byteLength;
  }

  /** Every message of the stream, in its order. */
  take(message: RawMessage): void {
    if (typeof message === 'string') {
      const { type } = JSON.parse(message) as TextMessage;
      if (type !== 'geometry' && type !== 'scene') return;
    } else if (new DataView(message).getUint32(0, true) === 4) return; // the full simulation beside it
    // A pause adds nothing to the past.
    if (RollingPast.isFrame(message)) {
      const time = new DataView(message as ArrayBuffer).getFloat64(16, true);
      if (time === this.time) return;
      this.time = time;
    }
    this.messages.push(message);
    this.bytes += RollingPast.size(message);
    if (RollingPast.isFrame(message)) ++this.frames;
    while (this.frames > MOST_FRAMES || (this.bytes > MOST_BYTES && this.frames > 1)) this.dropFirst();
  }

  private dropFirst(): void {
    const message = this.messages[this.first++];
    if (message === undefined) return;
    this.bytes -= RollingPast.size(message);
    if (RollingPast.isFrame(message)) --this.frames;
    else this.head.take(message);
    if (this.first < 1000) return;
    this.messages.splice(0, this.first);
    this.first = 0;
  }

  clear(): void {
    this.head = new Head();
    this.messages = [];
    this.first = this.frames = this.bytes = 0;
    this.time = NaN;
  }

  get length(): number {
    return this.frames;
  }

  /** A recording of it. */
  recording(): RawMessage[] {
    return [...this.head.messages, ...this.messages.slice(this.first)];
  }
}
