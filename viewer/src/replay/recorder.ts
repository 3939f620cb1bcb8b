// Keeps what a recording must begin with, and the stream while recording is on.
import { decodeBinary } from '../wire/decode';
import type { TextMessage } from '../wire/messages';
import type { RawMessage } from './log';

/** Ten minutes at 60 frames a second. */
export const MOST_FRAMES = 36_000;

export class StreamRecorder {
  private geometry: RawMessage | null = null;
  private meshes: RawMessage | null = null;
  private scene: RawMessage | null = null;
  private readonly maps = new Map<number, RawMessage>(); // newest of each root
  private messages: RawMessage[] | null = null;
  frames = 0;

  get recording(): boolean {
    return this.messages !== null;
  }

  /** Every message of the stream, in its order. */
  take(message: RawMessage): void {
    let isFrame = false;
    if (typeof message === 'string') {
      const { type } = JSON.parse(message) as TextMessage;
      if (type === 'geometry') {
        this.geometry = message;
        this.meshes = null; // of another geometry; its own follow
      } else if (type === 'scene') {
        this.scene = message;
        this.maps.clear();
      } else return;
    } else {
      const kind = new DataView(message).getUint32(0, true);
      if (kind === 4) return; // the full simulation beside it lags by as much as it likes: no part of a recording
      isFrame = kind === 2;
      if (kind === 3) this.meshes = message;
      if (kind === 1) {
        const binary = decodeBinary(message);
        if (binary.kind === 'maps') this.maps.set(binary.maps.root, message);
      }
    }
    if (!this.messages) return;
    this.messages.push(message);
    if (isFrame && ++this.frames >= MOST_FRAMES) this.onFull();
  }

  /** Called when there is no more room; set by who records. */
  onFull: () => void = () => undefined;

  start(): void {
    this.frames = 0;
    this.messages = [this.geometry, this.meshes, this.scene, ...this.maps.values()].filter((m) => m !== null);
  }

  /** Ends the recording and hands it over. */
  stop(): RawMessage[] {
    const messages = this.messages ?? [];
    this.messages = null;
    return messages;
  }
}
