// A thousand mechanisms: a draw for each kind of them, not for each of them.
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { poseOf, ready, screenOf, session, view } from './support';

const SIDE = 32;
const ARMS = 1000;
const CRATES = 20;

// Two-link arms on a grid, no two of equal stiffness, and crates. Boxes, because this is drawn without a GPU.
function field(): string {
  const arms = Array.from({ length: ARMS }, (_, i) => {
    const at = `${0.5 * (i % SIDE)} ${0.5 * Math.floor(i / SIDE)} 0.5`;
    return `<body name="upper_${i}" pos="${at}"><joint name="shoulder_${i}" axis="0 1 0" stiffness="${4 + 0.01 * i}" damping="0.1"/>
      <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/>
      <body name="lower_${i}" pos="0.2 0 0"><joint name="elbow_${i}" axis="0 1 0" stiffness="${1 + 0.002 * i}" damping="0.05"/>
      <geom type="box" size="0.08 0.015 0.015" pos="0.08 0 0"/></body></body>`;
  });
  const crates = Array.from(
    { length: CRATES },
    (_, i) => `<body name="crate_${i}" pos="${0.5 * i} -1 1"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>`,
  );
  const tips = Array.from({ length: ARMS }, (_, i) => `lower_${i}`).join(' ');
  return `<mujoco model="field"><custom><text name="fork1s_interface" data="${tips}"/></custom>
    <worldbody><geom type="plane" size="0 0 1"/>${arms.join('')}${crates.join('')}</worldbody></mujoco>`;
}

describe.skipIf(!ready)('a thousand mechanisms', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const file = join(folder, 'field.xml');
  writeFileSync(file, field());
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file));

  it('are as many draws as there are kinds of them', async () => {
    const drawn = await live.page.evaluate(() => {
      if (!fork1s) return null;
      const { info } = fork1s.view.stage.renderer;
      fork1s.view.draw();
      return {
        calls: info.render.calls,
        bodies: fork1s.view.scene?.bodies.length,
        batches: fork1s.view.bodies.batches.map((b) => ({ members: b.firsts.length, triangles: (b.geometry.index?.count ?? 0) / 3 })),
      };
    });
    expect(drawn?.bodies).toBe(3 * ARMS + CRATES); // each arm stands on a base of its own
    // Twelve triangles a box; the buffers do not grow with the number of mechanisms.
    expect(drawn?.batches.map((b) => b.members).sort((a, b) => b - a)).toEqual([ARMS, CRATES]);
    expect(drawn?.batches.map((b) => b.triangles).sort((a, b) => b - a)).toEqual([24, 12]);
    // Two kinds, ground, grid, shafts and heads of arrows; a shadow for each kind.
    expect(drawn?.calls).toBeLessThanOrEqual(8);
  });

  it('stand where they should, each as its own stiffness lets it', async () => {
    const { page } = live;
    // Bases are up to 20 m from the origin, where single precision tells 2e-6 m apart.
    expect(await page.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(4e-6);
    const heights = await page.evaluate(() => {
      const poses = fork1s?.view.poses() ?? [];
      return (fork1s?.view.scene?.bodies ?? []).flatMap((b, i) => (b.name.startsWith('lower') ? [poses[i]?.p[2] ?? NaN] : []));
    });
    expect(heights.length).toBe(ARMS);
    expect(new Set(heights.map((z) => z.toFixed(6))).size).toBeGreaterThan(ARMS / 2);
  });

  it('are told apart by the pointer', async () => {
    const { page } = live;
    await page.keyboard.press('Space');
    await page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    for (const name of ['upper_0', 'upper_517', 'upper_999', 'crate_3']) {
      // From far away a beam is less than a pixel.
      const [x = 0, y = 0, z = 0] = await poseOf(page, name);
      await page.evaluate(
        (p) => {
          fork1s?.view.stage.goHome();
          fork1s?.view.stage.lookFrom(undefined, undefined, 20, p);
          fork1s?.view.draw();
        },
        [x, y, z] as const,
      );
      const at = await screenOf(page, name, name.startsWith('upper') ? [0.1, 0, 0] : [0, 0, 0]);
      const hit = await page.evaluate(({ x, y }) => {
        const view = fork1s?.view;
        const found = view?.bodies.picker.pick(view.stage.renderer, view.stage.camera, x, y);
        return view?.scene?.bodies[found?.body ?? -1]?.name;
      }, at);
      expect(hit).toBe(name);
    }
  });
});
