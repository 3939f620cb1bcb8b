// A recording: the messages of a stream, in order. The same bytes in the page, in a replay file and on disk:
// for each message a word that is 1 for binary ones, a word for its length, then its bytes.
import { decodeBinary } from '../wire/decode';
import type { Library } from '../wire/library';
import type { Frame, TextMessage } from '../wire/messages';

export type RawMessage = string | ArrayBuffer;

export function pack(messages: readonly RawMessage[]): Uint8Array {
  const parts = messages.map((m) => (typeof m === 'string' ? new TextEncoder().encode(m) : new Uint8Array(m)));
  const out = new Uint8Array(parts.reduce((size, p) => size + 8 + p.length, 0));
  const view = new DataView(out.buffer);
  let at = 0;
  parts.forEach((part, i) => {
    view.setUint32(at, typeof messages[i] === 'string' ? 0 : 1, true);
    view.setUint32(at + 4, part.length, true);
    out.set(part, at + 8);
    at += 8 + part.length;
  });
  return out;
}

export function unpack(bytes: Uint8Array): RawMessage[] {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const messages: RawMessage[] = [];
  for (let at = 0; at < bytes.byteLength; ) {
    const binary = view.getUint32(at, true) === 1;
    const size = view.getUint32(at + 4, true);
    if (at + 8 + size > bytes.byteLength) throw new RangeError('the recording is cut off');
    const part = bytes.slice(at + 8, at + 8 + size);
    messages.push(binary ? part.buffer : new TextDecoder().decode(part));
    at += 8 + size;
  }
  return messages;
}

export function toBase64(bytes: Uint8Array): string {
  let text = '';
  for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
  return btoa(text);
}

export function fromBase64(text: string): Uint8Array {
  return Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
}

export const RECORDING_ID = 'fork1s-recording';

/** The page with a recording in it: one file that plays from disk. */
export function replayPage(page: string, messages: readonly RawMessage[]): string {
  const end = page.lastIndexOf('</body>');
  const data = `<script type="text/plain" id="${RECORDING_ID}">${toBase64(pack(messages))}</script>\n`;
  return page.slice(0, end) + data + page.slice(end);
}

export interface Moment {
  time: number; // s
  message: ArrayBuffer;
}

/** Messages taken apart: what comes before frames goes to the library, frames stay as they are. */
export class Log {
  readonly moments: Moment[] = [];

  constructor(messages: readonly RawMessage[], library: Library) {
    for (const message of messages) {
      if (typeof message === 'string') {
        const text = JSON.parse(message) as TextMessage;
        if (text.type === 'scene') library.addScene(text);
        else if (text.type === 'geometry') library.addGeometry(text);
        continue;
      }
      const binary = decodeBinary(message);
      if (binary.kind === 'maps') library.addMaps(binary.maps);
      else if (binary.kind === 'meshes') library.addMeshes(binary.meshes, binary.pictures);
      else if (binary.kind === 'frame') this.moments.push({ time: binary.frame.scalars[0] ?? 0, message });
    }
  }

  get start(): number {
    return this.moments[0]?.time ?? 0;
  }
  get end(): number {
    return this.moments.at(-1)?.time ?? 0;
  }

  /** The last frame at or before a time. Times may jump back where the simulation was reset; the order rules. */
  frameAt(index: number): Frame | null {
    const moment = this.moments[Math.min(this.moments.length - 1, Math.max(0, index))];
    if (!moment) return null;
    const binary = decodeBinary(moment.message);
    return binary.kind === 'frame' ? binary.frame : null;
  }
}
