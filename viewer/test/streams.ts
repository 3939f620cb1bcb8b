// Streams that the program's own tests wrote, with the poses it says belong to their frames.
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { decodeBinary } from '../src/wire/decode';
import { Library } from '../src/wire/library';
import type { Frame, Maps, SceneMessage, TextMessage } from '../src/wire/messages';

export const STREAMS = process.env['FORK1S_STREAMS'] ?? '';
export const NAMES = ['hand_exact', 'hand_twist', 'hexapod_exact', 'firemen_exact', 'firemen_twist'];

export interface Stream {
  messages: (string | ArrayBuffer)[];
  frames: { scene: SceneMessage; frame: Frame; maps: (Maps | null)[]; poses: number[] }[];
}

export function haveStreams(): boolean {
  return STREAMS !== '' && existsSync(join(STREAMS, 'hand_exact.stream'));
}

export function splitStream(bytes: Uint8Array): (string | ArrayBuffer)[] {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const messages: (string | ArrayBuffer)[] = [];
  for (let at = 0; at < bytes.byteLength; ) {
    const binary = view.getUint32(at, true) === 1;
    const size = view.getUint32(at + 4, true);
    const part = bytes.slice(at + 8, at + 8 + size);
    messages.push(binary ? part.buffer : new TextDecoder().decode(part));
    at += 8 + size;
  }
  return messages;
}

export function readStream(name: string): Stream {
  const messages = splitStream(new Uint8Array(readFileSync(join(STREAMS, `${name}.stream`))));
  const poses = JSON.parse(readFileSync(join(STREAMS, `${name}.poses.json`), 'utf8')) as number[][];
  const library = new Library();
  const frames: Stream['frames'] = [];
  for (const message of messages) {
    if (typeof message === 'string') {
      const text = JSON.parse(message) as TextMessage;
      if (text.type === 'scene') library.addScene(text);
      continue;
    }
    const binary = decodeBinary(message);
    if (binary.kind === 'maps') library.addMaps(binary.maps);
    if (binary.kind !== 'frame') continue;
    const scene = library.scene(binary.frame.epoch);
    const maps = library.mapsOf(binary.frame);
    if (!scene || !maps) throw new Error('a frame came before what it refers to');
    frames.push({ scene, frame: binary.frame, maps, poses: poses[frames.length] ?? [] });
  }
  return { messages, frames };
}
