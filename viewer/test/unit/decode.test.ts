import { describe, expect, it } from 'vitest';
import { decodeBinary, SCALARS } from '../../src/wire/decode';
import { Library } from '../../src/wire/library';
import { allFinite } from '../../src/net/live';
import { haveStreams, readStream } from '../streams';

describe('decodeBinary', () => {
  it('throws on what it does not know', () => {
    expect(() => decodeBinary(new ArrayBuffer(0))).toThrow(RangeError);
    expect(() => decodeBinary(new Uint32Array([9, 0, 0]).buffer)).toThrow(RangeError);
  });

  it('throws on a message that promises more than it holds', () => {
    expect(() => decodeBinary(new Uint32Array([1, 1, 0, 1, 1000, 1000, 1, 0]).buffer)).toThrow(RangeError);
    expect(() => decodeBinary(new Uint32Array([3, 1, 4000000000, 1]).buffer)).toThrow(RangeError);
  });
});

describe.skipIf(!haveStreams())('a stream of the program', () => {
  it('has as many scalars as the page expects', () => {
    const { frames } = readStream('hand_exact');
    expect(frames[0]?.scene.scalars.length).toBe(SCALARS);
    expect(frames[0]?.frame.scalars.length).toBe(SCALARS);
  });

  it('carries base poses, z and contacts, and corrections only where there are loops', () => {
    const hand = readStream('hand_exact').frames;
    expect(hand.every((f) => f.frame.roots.every((r) => r.correction.length === 0))).toBe(true);
    expect(hand.some((f) => f.frame.contacts.length > 0)).toBe(true);
    expect(hand.every((f) => f.frame.pulls.length === 1)).toBe(true);
    const firemen = readStream('firemen_exact').frames;
    expect(firemen.some((f) => f.frame.roots.some((r) => r.correction.length > 0))).toBe(true);
  });

  it('cut off anywhere throws and never hangs', () => {
    const frame = readStream('hand_exact').messages.at(-1) as ArrayBuffer;
    for (let size = 0; size < frame.byteLength; size += 7)
      expect(() => decodeBinary(frame.slice(0, size))).toThrow(RangeError);
  });
});

describe('Library', () => {
  it('knows no maps for a frame that came too early', () => {
    const frame = { epoch: 1, sequence: 1, paused: false, scalars: new Float64Array(), roots: [], contacts: [], pulls: [], signals: new Float32Array() };
    expect(new Library().mapsOf(frame)).toBeUndefined();
  });
});

describe('allFinite', () => {
  it('finds what must not be sent', () => {
    expect(allFinite({ type: 'pull', point: [0, 1, 2] })).toBe(true);
    expect(allFinite({ type: 'pull', point: [0, NaN, 2] })).toBe(false);
    expect(allFinite({ type: 'set', value: Infinity })).toBe(false);
  });
});
