// What a frame costs the page, everything shown: the page's own work, apart from what the GPU does.
//
//   node tools/page_cost.mjs MODEL...     in build/release/viewer/work, with FORK1S_BINARY set
import { spawn } from 'node:child_process';
import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';

const models = process.argv.slice(2);
const binary = process.env['FORK1S_BINARY'];
const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find((p) => existsSync(p));
if (!binary || !executablePath || models.length === 0) throw new Error('needs FORK1S_BINARY, a chromium in /usr/bin and a model');

const FRAMES = 60;
const browser = await chromium.launch({ executablePath, args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'] });
process.stdout.write('model,bodies,triangles,draws,plain_ms,overlays_ms\n');
for (const model of models) {
  const child = spawn(binary, ['view', model, '--no-open', '--port', '0', '--json'], { stdio: ['ignore', 'pipe', 'inherit'] });
  const address = await new Promise((done) => child.stdout.on('data', (d) => done(/"address":"([^"]+)"/.exec(d)?.[1])));
  const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
  await page.goto(address);
  await page.waitForFunction(() => globalThis.fork1s?.framesTaken > 2 && fork1s.view.framesDrawn > 2);
  const devtools = await page.context().newCDPSession(page);
  await devtools.send('Performance.enable', { timeDomain: 'threadTicks' }); // processor time of the page's thread
  const busy = async () => (await devtools.send('Performance.getMetrics')).metrics.find((m) => m.name === 'TaskDuration').value;
  // Draws one frame after the other; the wait for the picture is the graphics process's, and costs this thread nothing.
  const draw = (count) =>
    page.evaluate(async (times) => {
      const { view } = fork1s;
      view.stage.renderer.setAnimationLoop(null); // no drawing but what is measured
      fork1s.take = () => undefined;
      const maps = view.maps;
      for (let i = 0; i < times; ++i) {
        view.setFrame(view.scene, view.shapes, { ...view.frame }, maps);
        view.draw();
        view.stage.renderer.getContext().finish();
        await new Promise((done) => setTimeout(done, 0));
      }
    }, count);
  const cost = async () => {
    await draw(5);
    const before = await busy();
    await draw(FRAMES);
    return ((1000 * ((await busy()) - before)) / FRAMES).toFixed(2);
  };
  await draw(1);
  const plain = await cost();
  const told = await page.evaluate(() => {
    const { view } = fork1s;
    const found = [view.scene.bodies.length, view.bodies.triangles];
    Object.assign(view.options, { axes: true, centers: true, inertia: true, tendons: true, cones: true, compliance: true, frames: true });
    view.restyle();
    return found;
  });
  const overlays = await cost();
  const calls = await page.evaluate(() => fork1s.view.stage.renderer.info.render.calls);
  const row = [...told, calls, plain, overlays];
  process.stdout.write(`${[model.split('/').slice(-2).join('/'), ...row].join(',')}\n`);
  await page.close();
  child.kill();
}
await browser.close();
