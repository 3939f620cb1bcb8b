import { describe, expect, it } from 'vitest';
import { otherPoses } from '../../src/poses/other_recovery';
import { bodyPoses } from '../../src/poses/reference';
import { haveStreams, readStream } from '../streams';

const never = (): never => {
  throw new Error('the stream has no frames');
};

describe.skipIf(!haveStreams())('the other recovery mode on the same state', () => {
  // The program sends its twists T in the mode that takes them; here they come from screws, q_ref and Q.
  for (const name of ['hand_twist', 'firemen_twist'])
    it(`${name}: twists made from joints are those that the program sends`, () => {
      let apart = 0;
      for (const { scene, frame, maps } of readStream(name).frames) {
        const told = bodyPoses(scene, frame, maps);
        const made = otherPoses({ ...scene, recovery: 'exact' }, frame, maps);
        expect(made?.length).toBe(told.length);
        made?.forEach((X, b) => (apart = Math.max(apart, Math.hypot(...X.p.map((x, k) => x - (told[b]?.p[k] ?? NaN))))));
      }
      expect(apart).toBeLessThan(1e-6); // T travels in single precision
    });

  it('they part by the square of how far joints are bent', () => {
    const { scene, frame, maps } = readStream('hand_exact').frames.slice(-1)[0] ?? never();
    const size = Math.max(...frame.roots.flatMap((r) => [...r.z].map(Math.abs)));
    const apart = [0.1, 0.05].map((most) => {
      const share = most / size;
      const bent = { ...frame, roots: frame.roots.map((r) => ({ ...r, z: r.z.map((x) => share * x), correction: new Float32Array() })) };
      const exact = bodyPoses(scene, bent, maps);
      const twist = otherPoses(scene, bent, maps) ?? [];
      return Math.max(...exact.map((X, b) => Math.hypot(...X.p.map((x, k) => x - (twist[b]?.p[k] ?? NaN)))));
    });
    expect(apart[0]).toBeGreaterThan(1e-5);
    expect((apart[0] ?? 0) / (apart[1] ?? 1)).toBeGreaterThan(3.5);
    expect((apart[0] ?? 0) / (apart[1] ?? 1)).toBeLessThan(4.5);
  });

  it('where loops are, twists do not tell the joints', () => {
    const { scene, frame, maps } = readStream('firemen_twist').frames[0] ?? never();
    expect(otherPoses(scene, frame, maps)).toBeNull();
  });
});
