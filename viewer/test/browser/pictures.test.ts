// A picture on a mesh is where the file puts it, and gives way to colours that mean something.
import { mkdtempSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { ready, session, view } from './support';

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

describe.skipIf(!ready)('pictures', () => {
  const live = session(() => {
    const path = join(mkdtempSync(join(tmpdir(), 'pictures-')), 'cubes.xml');
    writeFileSync(path, MODEL);
    return view(path);
  });
  const strongest = (name: string): Promise<string> =>
    live.page.evaluate((wanted) => {
      if (!fork1s) return 'none';
      const { view: shown } = fork1s;
      const { x, y } = fork1s.screenOf(shown.scene?.bodies.findIndex((b) => b.name === wanted) ?? -1);
      shown.draw();
      const gl = shown.stage.renderer.getContext();
      const scale = shown.stage.renderer.getPixelRatio();
      const pixel = new Uint8Array(4);
      gl.readPixels(x * scale, gl.drawingBufferHeight - y * scale, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      const [r = 0, g = 0, b = 0] = pixel;
      const most = Math.max(r, g, b);
      const rest = r + g + b - most;
      return most < rest ? `${r} ${g} ${b}` : most === r ? 'red' : most === g ? 'green' : 'blue';
    }, name);

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
