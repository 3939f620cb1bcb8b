// A picture on a mesh is where the file puts it, and gives way to colours that mean something.
import { mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { ready, resize, session, view } from './support';

// Cubes that show one quarter of a board each: upper left and lower right are red, the others blue.
const cube = (name: string, uv: string): string =>
  `<mesh name="${name}" vertex="-.1 -.1 -.1 .1 -.1 -.1 .1 .1 -.1 -.1 .1 -.1 -.1 -.1 .1 .1 -.1 .1 .1 .1 .1 -.1 .1 .1"
   face="0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7" texcoord="${`${uv} `.repeat(8)}"/>`;
const MODEL = `<mujoco><option gravity="0 0 0"/><asset>
  <texture name="board" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
  <material name="board" texture="board"/>${cube('upper_left', '.25 .25')}${cube('lower_left', '.25 .75')}</asset>
  <worldbody>
    <body name="red" pos="-.3 0 0"><freejoint/><geom type="mesh" mesh="upper_left" material="board"/></body>
    <body name="blue"><freejoint/><geom type="mesh" mesh="lower_left" material="board"/></body>
    <body name="green" pos=".3 0 0"><freejoint/><geom type="mesh" mesh="lower_left" rgba="0 1 0 1"/></body>
  </worldbody></mujoco>`;

/** Which of red, green and blue is strongest at a point of a body, of the world where there is none of that name. */
const strongestAt = (page: Page, name: string, point?: [number, number, number]): Promise<string> =>
  page.evaluate(
    ([wanted, at]) => {
      if (!fork1s) return 'none';
      const { view: shown } = fork1s;
      const { x, y } = fork1s.screenOf(shown.scene?.bodies.findIndex((b) => b.name === wanted) ?? -1, at);
      shown.draw();
      const gl = shown.stage.renderer.getContext();
      const scale = shown.stage.renderer.getPixelRatio();
      const pixel = new Uint8Array(4);
      gl.readPixels(x * scale, gl.drawingBufferHeight - y * scale, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      const [r = 0, g = 0, b = 0] = pixel;
      const most = Math.max(r, g, b);
      const rest = r + g + b - most;
      return most < rest ? `${r} ${g} ${b}` : most === r ? 'red' : most === g ? 'green' : 'blue';
    },
    [name, point] as const,
  );

describe.skipIf(!ready)('pictures', () => {
  const live = session(() => {
    const path = join(mkdtempSync(join(tmpdir(), 'pictures-')), 'cubes.xml');
    writeFileSync(path, MODEL);
    return view(path);
  });
  const strongest = (name: string): Promise<string> => strongestAt(live.page, name);

  it('lie where the file says', async () => {
    await live.page.waitForFunction(() => fork1s?.view.frame);
    await live.page.evaluate(() => fork1s?.view.bodies.pictures.ready);
    for (const name of ['red', 'blue', 'green']) expect(await strongest(name)).toBe(name);
  });

  it('give way to colours by role', async () => {
    await live.page.evaluate(() => {
      if (!fork1s) return;
      fork1s.view.options.colouring = 'roles';
      fork1s.view.restyle();
    });
    for (const name of ['red', 'blue', 'green']) expect(await strongest(name)).not.toMatch(/^(red|green)$/); // free bodies are of one tone
  });
});

// A picture lies in the middle of its plane: one over 2 m of the ground, two along x over the rug.
const GROUND = `<mujoco><option gravity="0 0 0"/><asset>
  <texture name="board" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
  <texture name="lawn" type="2d" builtin="checker" rgb1="0 .5 0" rgb2="1 0 0" width="64" height="64"/>
  <material name="board" texture="board"/><material name="lawn" texture="lawn" texrepeat="2 1"/></asset>
  <worldbody>
    <geom type="plane" size="0 0 .1" material="board"/>
    <geom type="plane" size=".2 .2 .1" pos=".6 0 .01" material="lawn"/>
    <geom type="plane" size=".1 .1 .1" pos="0 0 3" euler="0 40 0" material="lawn" contype="0" conaffinity="0"/>
    <body name="ball" pos="0 0 .8"><freejoint/><geom type="sphere" size=".2"/></body>
  </worldbody></mujoco>`;

describe.skipIf(!ready)('pictures of planes', () => {
  const live = session(() => {
    const path = join(mkdtempSync(join(tmpdir(), 'pictures-')), 'ground.xml');
    writeFileSync(path, GROUND);
    return view(path);
  });
  const gridShown = (): Promise<boolean> => live.page.evaluate(() => fork1s?.view.stage.gridShown ?? false);

  it('repeat as the file says, on a dark page too, in place of the grid', async () => {
    await live.page.waitForFunction(() => fork1s?.view.frame);
    await live.page.evaluate(() => fork1s?.view.bodies.pictures.ready);
    for (const turnedDark of [false, true]) {
      if (turnedDark) await live.page.keyboard.press('t');
      // Looked at from above, the ground is all around the ball.
      await live.page.evaluate(() => fork1s?.view.stage.lookFrom(-90, 89, 0.3, [0, 0, 0]));
      const seen: string[] = [];
      for (const [x, y] of [[-0.4, 0.4], [0.4, 0.4], [-0.4, -0.4], [0.4, -0.4], [1.3, 0.4], [-1.3, 0.4]] as const)
        seen.push(await strongestAt(live.page, '', [x, y, 0]));
      expect(seen).toEqual(['red', 'blue', 'blue', 'red', 'red', 'blue']);
      const rug: string[] = [];
      for (const x of [0.45, 0.55, 0.65, 0.75]) rug.push(await strongestAt(live.page, '', [x, 0.1, 0.01]));
      expect(rug).toEqual(['red', 'green', 'red', 'green']);
    }
    expect(await gridShown()).toBe(false);
  });

  // The ground is transparent: whatever is drawn before it and writes no depth disappears.
  it('show contact forces that lie over them', async () => {
    await resize(live.page, 480, 640); // an arrow is wider than a pixel
    const seen = await live.page.evaluate(() => {
      const { view: shown } = fork1s ?? {};
      if (!shown?.scene || !shown.frame) return [];
      const { stage, frame, scene } = shown;
      stage.lookFrom(-90, 30, 1, [0, 0, 0]);
      shown.draw();
      const gl = stage.renderer.getContext();
      const scale = stage.renderer.getPixelRatio();
      const redness = (at: [number, number, number]): number => {
        const { x, y } = fork1s?.screenOf(-1, at) ?? { x: 0, y: 0 };
        const pixel = new Uint8Array(4);
        stage.render();
        gl.readPixels(x * scale, gl.drawingBufferHeight - y * scale, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        return (pixel[0] ?? 0) - (pixel[2] ?? 0);
      };
      const point: [number, number, number] = [-0.5, -0.5, 0];
      const middle: [number, number, number] = [-0.5, -0.5, 0.07 * shown.modelSize];
      const contact = { a: -1, b: 0, point, normal: [0, 0, 1], force: [0, 0, 1], gap: 0, friction: 0.5 } as (typeof frame.contacts)[number];
      const differences: number[] = [];
      for (const contacts of [[], [contact]]) {
        shown.contacts.update(scene, { ...frame, contacts }, shown.modelSize);
        differences.push(redness(middle));
      }
      return differences;
    });
    const [without = 0, withArrow = 0] = seen;
    expect(withArrow).toBeGreaterThan(without + 60);
  });

  it('are hidden with the still world, and the grid is back', async () => {
    await live.page.evaluate(() => {
      if (!fork1s) return;
      fork1s.view.options.world = false;
      fork1s.view.restyle();
    });
    expect(await gridShown()).toBe(true);
    expect(await strongestAt(live.page, '', [-0.4, 0.4, 0])).not.toMatch(/^(red|green|blue)$/);
  });
});
