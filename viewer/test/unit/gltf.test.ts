// Files of `fork1s export` under the eyes of others: Khronos' validator and three.js' loader.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { validateBytes } from 'gltf-validator';
import { AnimationMixer, Box3, LoopOnce, Mesh, Quaternion, Vector3, type Object3D } from 'three';
import { GLTFLoader, type GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';

const BINARY = process.env['FORK1S_BINARY'] ?? '';
const SOURCE = process.env['FORK1S_SOURCE_DIR'] ?? '';

/** Poses after each step by `fork1s export run.h5 FOLDER`: time, then x y z qw qx qy qz of each body. */
function readPoses(folder: string): { bodies: string[]; rows: number[][] } {
  const lines = readFileSync(join(folder, 'poses.csv'), 'utf8').trim().split('\n');
  const columns = (lines[0] ?? '').split(',').slice(1);
  const bodies = columns.filter((c) => c.endsWith('.x')).map((c) => c.slice(0, -2));
  return { bodies, rows: lines.slice(1).map((line) => line.split(',').map(Number)) };
}

const load = (file: Uint8Array): Promise<GLTF> =>
  new GLTFLoader().parseAsync(file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength) as ArrayBuffer, '');

function node(gltf: GLTF, name: string): Object3D {
  const found = gltf.scene.getObjectByName(name);
  if (!found) throw new Error(`no node ${name}`);
  return found;
}

describe.skipIf(!existsSync(BINARY))('glTF files', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-gltf-'));
  const fork1s = (...args: string[]): void => {
    execFileSync(BINARY, args, { stdio: 'ignore' });
  };
  // Wheels that turn, terrain, a hand with a mesh, a net of ropes with a free body.
  const scenes = ['vehicle', 'hexapod_terrain', 'grasp_mug', 'firemen'];

  beforeAll(() => {
    for (const name of scenes) {
      const recording = join(folder, `${name}.h5`);
      const controls = join(SOURCE, 'scenes', `${name}.csv`);
      fork1s('run', join(SOURCE, 'scenes', `${name}.xml`), '--time', '0.5', '--record', recording,
        ...(existsSync(controls) ? ['--controls', controls] : []));
      fork1s('export', recording, join(folder, name), '--all-bodies');
      for (const kind of ['glb', 'gltf']) fork1s('export', recording, join(folder, `${name}.${kind}`));
    }
  }, 60_000);
  afterAll(() => rmSync(folder, { recursive: true, force: true }));

  for (const name of scenes)
    for (const kind of ['glb', 'gltf'])
      it(`${name}.${kind} has neither errors nor warnings`, async () => {
        const report = await validateBytes(new Uint8Array(readFileSync(join(folder, `${name}.${kind}`))));
        expect(report.issues.messages.filter((m) => m.severity < 2)).toEqual([]);
        expect(report.info.animationCount).toBe(1);
        expect(report.info.totalTriangleCount).toBeGreaterThan(100);
      });

  it('is valid with pictures on a mesh and a floor', async () => {
    const model = join(folder, 'picture.xml');
    writeFileSync(
      model,
      `<mujoco><asset><texture name="squares" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="8" height="6"/>
       <material name="squares" texture="squares" texrepeat="5 5" texuniform="true"/>
       <mesh name="tetra" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1" face="0 2 1 0 1 3 0 3 2 1 2 3" texcoord="0 0 1 0 0 1 .5 .5"/></asset>
       <worldbody><geom type="plane" size="0 0 .1" material="squares"/>
       <body pos="0 0 .3"><freejoint/><geom type="mesh" mesh="tetra" material="squares"/></body></worldbody></mujoco>`,
    );
    fork1s('run', model, '--time', '0.1', '--record', join(folder, 'picture.h5'));
    for (const kind of ['glb', 'gltf']) {
      fork1s('export', join(folder, 'picture.h5'), join(folder, `picture.${kind}`));
      const report = await validateBytes(new Uint8Array(readFileSync(join(folder, `picture.${kind}`))));
      expect(report.issues.messages.filter((m) => m.severity < 2)).toEqual([]);
      expect(report.info.hasTextures).toBe(true);
    }
  });

  for (const name of scenes)
    it(`${name} plays in three.js as it was simulated`, async () => {
      const gltf = await load(readFileSync(join(folder, `${name}.glb`)));
      const { bodies, rows } = readPoses(join(folder, name));
      const [clip] = gltf.animations;
      if (!clip) throw new Error('no animation');
      const mixer = new AnimationMixer(gltf.scene);
      const action = mixer.clipAction(clip).setLoop(LoopOnce, 1);
      action.clampWhenFinished = true;
      action.play();
      const yUp = new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -Math.PI / 2);
      const first = rows[0]?.[0] ?? 0;
      const dt = (rows[1]?.[0] ?? 0) - first;
      let moved = 0;
      for (const row of rows) {
        const time = (row[0] ?? 0) - first + dt;
        // Between keys it is an interpolation: only moments that are keys can be asked for.
        if (!clip.tracks[0]?.times.some((t) => Math.abs(t - time) < 1e-5)) continue;
        mixer.setTime(time);
        gltf.scene.updateMatrixWorld(true);
        bodies.forEach((body, i) => {
          const [x = 0, y = 0, z = 0, qw = 0, qx = 0, qy = 0, qz = 0] = row.slice(1 + 7 * i, 8 + 7 * i);
          const object = node(gltf, body);
          const p = object.getWorldPosition(new Vector3());
          const q = object.getWorldQuaternion(new Quaternion());
          // Floats of 24 bits: 1e-7 of places within a few metres, and key times that are as coarse.
          expect(p.distanceTo(new Vector3(x, y, z).applyQuaternion(yUp))).toBeLessThan(2e-6);
          const wanted = yUp.clone().multiply(new Quaternion(qx, qy, qz, qw));
          const sign = Math.sign(q.dot(wanted));
          expect(Math.hypot(...q.toArray().map((v, k) => v - sign * (wanted.toArray()[k] ?? 0)))).toBeLessThan(2e-6);
          const [x0 = 0, y0 = 0, z0 = 0] = rows[0]?.slice(1 + 7 * i) ?? [];
          moved = Math.max(moved, Math.hypot(x - x0, y - y0, z - z0));
        });
      }
      expect(moved).toBeGreaterThan(1e-3);
      let meshes = 0;
      gltf.scene.traverse((o) => (meshes += o instanceof Mesh ? 1 : 0));
      expect(meshes).toBeGreaterThan(bodies.length / 2);
      const size = new Box3().setFromObject(gltf.scene).getSize(new Vector3());
      expect(size.length()).toBeLessThan(100);
    });
});
