import { describe, expect, it } from 'vitest';
import { bodyPoses } from '../../src/poses/reference';
import { haveStreams, NAMES, readStream } from '../streams';

// z travels in single precision: 1e-6 m is ten times what that costs at arm's length.
describe.skipIf(!haveStreams())('poses in double precision are those of the program', () => {
  for (const name of NAMES)
    it(name, () => {
      const { frames } = readStream(name);
      expect(frames.length).toBe(60);
      let position = 0;
      let rotation = 0;
      for (const { scene, frame, maps, poses } of frames)
        bodyPoses(scene, frame, maps).forEach((X, b) => {
          const [x = 0, y = 0, z = 0, qw = 0, qx = 0, qy = 0, qz = 0] = poses.slice(7 * b, 7 * b + 7);
          position = Math.max(position, Math.hypot(X.p[0] - x, X.p[1] - y, X.p[2] - z));
          const dot = Math.abs(X.q[0] * qx + X.q[1] * qy + X.q[2] * qz + X.q[3] * qw);
          rotation = Math.max(rotation, Math.sqrt(Math.max(0, 1 - dot * dot)));
        });
      expect(position).toBeLessThan(1e-6);
      expect(rotation).toBeLessThan(1e-6);
    });
});
