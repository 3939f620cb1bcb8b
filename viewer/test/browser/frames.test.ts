// How many pictures a second a hand of meshes takes with everything drawn over it. That says something where a GPU draws; without
// one the test says so and measures nothing, unless FORK1S_FRAMES=1 asks for it. FORK1S_GPU=1 lets the browser use the GPU.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { launch, ready, SOURCE, view } from './support';

const SECONDS = 5;
const AROUND = 64;
const ALONG = 40;

/** A phalanx from the origin along x, a little thinner in its middle: 5000 triangles, as binary STL. */
function phalanx(length: number, radius: number): Buffer {
  const at = (i: number, k: number): [number, number, number] => {
    const s = i / ALONG; // round ends, a waist between them
    const x = -radius + s * (length + 2 * radius);
    const end = Math.max(0, -x, x - length) / radius;
    const r = radius * Math.sqrt(Math.max(0, 1 - end * end)) * (1 - 0.15 * Math.sin(Math.PI * s) ** 2);
    const turn = (2 * Math.PI * k) / AROUND;
    return [x, r * Math.cos(turn), r * Math.sin(turn)];
  };
  const triangles: [number, number, number][][] = [];
  for (let i = 0; i < ALONG; ++i)
    for (let k = 0; k < AROUND; ++k) {
      if (i > 0) triangles.push([at(i, k), at(i + 1, k), at(i, k + 1)]);
      if (i + 1 < ALONG) triangles.push([at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)]);
    }
  const stl = Buffer.alloc(84 + 50 * triangles.length);
  stl.writeUInt32LE(triangles.length, 80);
  triangles.forEach((corners, t) => corners.flat().forEach((x, i) => stl.writeFloatLE(x, 84 + 50 * t + 12 + 4 * i)));
  return stl;
}

/** scenes/hand.xml with a mesh before each phalanx, whose capsule becomes a collision shape. */
function handOfMeshes(folder: string): string {
  const meshes = new Set<string>();
  const text = readFileSync(join(SOURCE, 'scenes', 'hand.xml'), 'utf8')
    .replaceAll(/<geom class="(?:bone|pad)" fromto="0 0 0 ([\d.]+) 0 0" size="([\d.]+)"/g, (capsule, length: string, radius: string) => {
      const name = `phalanx_${length.replace('.', '')}_${radius.replace('.', '')}`;
      if (!meshes.has(name)) writeFileSync(join(folder, `${name}.stl`), phalanx(Number(length), Number(radius)));
      meshes.add(name);
      return `<geom type="mesh" mesh="${name}" mass="0" contype="0" conaffinity="0" rgba="0.85 0.7 0.6 1"/>\n${capsule} group="3"`;
    })
    .replace('<worldbody>', () => `<asset>${[...meshes].map((m) => `<mesh name="${m}" file="${m}.stl"/>`).join('')}</asset>\n<worldbody>`);
  const file = join(folder, 'hand_of_meshes.xml');
  writeFileSync(file, text);
  return file;
}

describe.skipIf(!ready)('frames a second', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  afterAll(() => rmSync(folder, { recursive: true, force: true }));

  it('of a hand of meshes with all overlays', async ({ skip }) => {
    const browser = await launch();
    const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    const drawer = await page.evaluate(() => {
      const gl = document.createElement('canvas').getContext('webgl2');
      const info = gl?.getExtension('WEBGL_debug_renderer_info');
      return gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : 'nothing';
    });
    if (/swiftshader|llvmpipe|software|nothing/i.test(drawer) && process.env['FORK1S_FRAMES'] !== '1') {
      await browser.close();
      process.stdout.write(`frames a second are not measured: no GPU, drawn by ${drawer}\n`);
      skip(`no GPU: drawn by ${drawer}`);
      return;
    }
    const program = await view(handOfMeshes(folder), '--keyframe', 'open');
    await page.goto(program.address);
    await page.waitForFunction(() => (fork1s?.framesTaken ?? 0) > 0, undefined, { timeout: 60_000 });
    await page.keyboard.press('p');
    const shown = await page.evaluate(() => {
      if (!fork1s) throw new Error('no page');
      const { options, numShapes } = fork1s.view;
      for (const name of ['cones', 'frames', 'reference', 'compliance', 'axes', 'centers', 'inertia', 'tendons'] as const) options[name] = true;
      options.colouring = 'gaps';
      fork1s.view.restyle();
      fork1s.send({ type: 'ghost', on: true });
      return numShapes;
    });
    expect(shown).toBeGreaterThan(16);
    await page.waitForFunction(() => fork1s?.view.fullShown === true, undefined, { timeout: 60_000 });
    const counts = (): Promise<[number, number]> => page.evaluate(() => [fork1s?.view.framesDrawn ?? 0, fork1s?.framesTaken ?? 0]);
    const [drawn, taken] = await counts();
    const start = performance.now();
    await page.waitForTimeout(1000 * SECONDS);
    const [drawnNow, takenNow] = await counts();
    const seconds = (performance.now() - start) / 1000;
    const rate = (count: number): string => (count / seconds).toFixed(1);
    process.stdout.write(`a hand of ${shown} shapes with all overlays: ${rate(drawnNow - drawn)} pictures and ${rate(takenNow - taken)} frames of the stream a second, drawn by ${drawer}\n`);
    expect(drawnNow).toBeGreaterThan(drawn);
    expect(takenNow).toBeGreaterThan(taken);
    await browser.close();
    await program.stop();
  });
});
