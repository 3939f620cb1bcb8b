// Bytes to messages. A message that is shorter than it says it is throws a RangeError.
import type { BinaryMessage, Contact, Frame, GhostFrame, Maps, MeshData, Pull, RootState } from './messages';

/** Numbers in every frame before its states: ScalarNames() of the program. */
export const SCALARS = 14;

class Reader {
  private at = 0;
  private readonly view: DataView;
  constructor(private readonly data: ArrayBuffer) {
    this.view = new DataView(data);
  }
  u32(): number {
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }
  i32(): number {
    this.at += 4;
    return this.view.getInt32(this.at - 4, true);
  }
  f32(): number {
    this.at += 4;
    return this.view.getFloat32(this.at - 4, true);
  }
  vector(): [number, number, number] {
    return [this.f32(), this.f32(), this.f32()];
  }
  private take(count: number, size: number): ArrayBuffer {
    const end = this.at + count * size;
    if (end > this.data.byteLength) throw new RangeError('message cut off');
    const bytes = this.data.slice(this.at, end);
    this.at = end;
    return bytes;
  }
  bytes(count: number): Uint8Array {
    return new Uint8Array(this.take(count, 1));
  }
  floats(count: number): Float32Array {
    return new Float32Array(this.take(count, 4));
  }
  doubles(count: number): Float64Array {
    return new Float64Array(this.take(count, 8));
  }
  words(count: number): Uint32Array {
    return new Uint32Array(this.take(count, 4));
  }
}

function decodeMaps(reader: Reader): Maps {
  const [epoch, root, version, n, r, bodies, twist] = reader.words(7) as unknown as number[] as [
    number, number, number, number, number, number, number,
  ];
  const maps: Maps = { epoch, root, version, n, r, bodies, q_ref: reader.doubles(n), Q: reader.floats(n * r), compliance: [] };
  if (twist === 1) maps.twist = { poses: reader.doubles(bodies * 7), T: reader.floats(bodies * r * 6) };
  for (let i = reader.u32(); i > 0; --i)
    maps.compliance.push({ body: reader.u32(), C: [...reader.floats(6)] });
  return maps;
}

function decodeFrame(reader: Reader): Frame {
  const epoch = reader.u32();
  const sequence = reader.u32();
  const paused = (reader.u32() & 1) === 1;
  const scalars = reader.doubles(SCALARS);
  const roots: RootState[] = [];
  for (let i = reader.u32(); i > 0; --i) {
    const version = reader.u32();
    const r = reader.u32();
    const n = reader.u32();
    roots.push({ version, pose: reader.doubles(7), z: reader.floats(r), correction: reader.floats(n) });
  }
  const contacts: Contact[] = [];
  for (let i = reader.u32(); i > 0; --i)
    contacts.push({
      a: reader.i32(),
      b: reader.i32(),
      point: reader.vector(),
      normal: reader.vector(),
      force: reader.vector(),
      gap: reader.f32(),
      friction: reader.f32(),
    });
  const pulls: Pull[] = [];
  for (let i = reader.u32(); i > 0; --i)
    pulls.push({ body: reader.i32(), point: reader.vector(), target: reader.vector(), force: reader.vector() });
  const signals = reader.floats(reader.u32());
  return { epoch, sequence, paused, scalars, roots, contacts, pulls, signals };
}

function decodeMeshes(reader: Reader): { meshes: MeshData[]; pictures: Uint8Array[] } {
  const meshes: MeshData[] = [];
  for (let i = reader.u32(); i > 0; --i) {
    const vertices = reader.u32();
    const triangles = reader.u32();
    const corners = reader.u32();
    meshes.push({
      positions: reader.floats(vertices * 3),
      triangles: reader.words(triangles * 3),
      uv: reader.floats(2 * corners),
    });
  }
  const pictures: Uint8Array[] = [];
  for (let i = reader.u32(); i > 0; --i) pictures.push(reader.bytes(reader.u32()));
  return { meshes, pictures };
}

function decodeGhost(reader: Reader): GhostFrame {
  const epoch = reader.u32();
  const [time, behind, distance] = reader.doubles(3) as unknown as [number, number, number];
  const body = reader.i32();
  return { epoch, time, behind, distance, body, poses: reader.floats(7 * reader.u32()) };
}

export function decodeBinary(data: ArrayBuffer): BinaryMessage {
  const reader = new Reader(data);
  switch (reader.u32()) {
    case 1:
      return { kind: 'maps', maps: decodeMaps(reader) };
    case 2:
      return { kind: 'frame', frame: decodeFrame(reader) };
    case 3:
      return { kind: 'meshes', ...decodeMeshes(reader) };
    case 4:
      return { kind: 'ghost', ghost: decodeGhost(reader) };
    default:
      throw new RangeError('unknown kind of message');
  }
}
