// Pictures of the live page for docs/: starts `fork1s view`, touches what is there, and takes the page.
//
//   node tools/page_pictures.mjs FOLDER [NAME...]     as tools/page_pictures.sh of the project does it
import { spawn } from 'node:child_process';
import { existsSync, mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { chromium } from 'playwright-core';

const [folder = '.', ...only] = process.argv.slice(2);
const binary = process.env['FORK1S_BINARY'];
const scenes = join(process.env['FORK1S_SOURCE_DIR'] ?? '.', 'scenes');
const executablePath = ['/usr/bin/chromium', '/usr/bin/chromium-browser'].find((p) => existsSync(p));
if (!binary || !executablePath) throw new Error('needs FORK1S_BINARY and a chromium in /usr/bin');

const seconds = (s) => new Promise((done) => setTimeout(done, 1000 * s));
// Plays the table of the command line until then; the hand stays as it stands there.
async function playUntil(page, time) {
  await page.waitForFunction((t) => fork1s.scalar('time') > t, time, { timeout: 120_000 });
  await page.evaluate(() =>
    fork1s.bench.settings.controls.forEach((value, index) => fork1s.send({ type: 'set', setting: 'control', index, value })),
  );
}
const grasp = ['grasp_sphere.xml', '--controls', join(scenes, 'grasp_sphere.csv')];
// Drags with the mouse, so that the page shows what it shows a person.
async function drag(page, body, dx, dy, point = [0, 0, 0]) {
  const at = await page.evaluate(
    ([name, p]) => fork1s.screenOf(fork1s.view.scene.bodies.findIndex((b) => b.name === name), p),
    [body, point],
  );
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  for (let i = 1; i <= 10; ++i) {
    await page.mouse.move(at.x + (dx * i) / 10, at.y + (dy * i) / 10);
    await seconds(0.05);
  }
  await seconds(1);
}
const options = (page, values) =>
  page.evaluate((v) => {
    Object.assign(fork1s.view.options, v);
    fork1s.view.restyle();
  }, values);
const look = (page, azimuth, elevation, zoom, body) =>
  page.evaluate(
    ([a, e, z, name]) => {
      const at = fork1s.view.scene.bodies.findIndex((b) => b.name === name);
      fork1s.view.stage.lookFrom(a, e, z, name ? fork1s.view.poses()[at].p : undefined);
    },
    [azimuth, elevation, zoom, body],
  );

const pictures = {
  page_hand: {
    model: grasp,
    async touch(page) {
      await page.keyboard.press('p');
      await playUntil(page, 3);
      await options(page, { cones: true });
      await seconds(2);
      await look(page, -60, 10, 1.15, 'ball');
      await seconds(1);
      await drag(page, 'ball', -70, 70);
    },
  },
  page_firemen: {
    model: ['firemen.xml'],
    async touch(page) {
      await look(page, -62, 14, 1.35);
      await options(page, { compliance: true });
      await page.evaluate(() => fork1s.send({ type: 'ghost', on: true }));
      await seconds(6);
      await drag(page, 'bunny', 90, -120);
    },
  },
  page_dark: {
    model: ['hexapod_terrain.xml'],
    async touch(page) {
      await page.keyboard.press('t');
      await look(page, -50, 24, 2.2, 'trunk');
      await options(page, { cones: true });
      await seconds(3);
      await drag(page, 'trunk', 60, -60);
    },
  },
  page_tree: {
    model: grasp,
    async touch(page) {
      await page.keyboard.press('m');
      await playUntil(page, 3);
      await options(page, { axes: true, centers: true, inertia: true });
      for (const name of ['joint axes', 'centres of mass', 'inertia boxes']) await page.getByLabel(name).check();
      await page.evaluate(() => {
        fork1s.bench.tree.choose(fork1s.view.scene.bodies.findIndex((b) => b.name === 'index_middle'));
        fork1s.view.visibility.setShare('palm', 0.35);
        fork1s.view.restyle();
      });
      await look(page, -60, 18, 1.2, 'ball');
      await seconds(2);
    },
  },
  page_tune: {
    model: ['hand.xml', '--keyframe', 'open'],
    async touch(page) {
      await page.keyboard.press('u');
      await page.keyboard.press('p');
      await page.evaluate(() => {
        fork1s.plots.toggle('q:index_knuckle_flex', true);
        fork1s.plots.toggle('f:index_knuckle_flex', true);
        fork1s.plots.overlay(fork1s.plots.signals.length - 1, 'tau:index_knuckle_flex');
        fork1s.bench.tree.choose(fork1s.view.scene.bodies.findIndex((b) => b.name === 'index_proximal'));
      });
      await page.getByLabel('only what is chosen in the scene').check();
      const kp = page.getByLabel('stiffness of actuator index_knuckle_flex', { exact: true });
      const set = (value) =>
        page.evaluate((v) => {
          const index = fork1s.view.scene.controls.findIndex((c) => c.name === 'index_knuckle_flex');
          fork1s.send({ type: 'set', setting: 'control', index, value: v });
        }, value);
      await set(0.6);
      await seconds(3);
      await kp.fill('0,4');
      await kp.press('Enter');
      await seconds(2);
      await set(0.2);
      await seconds(2);
    },
  },
  page_shape: {
    model: ['hand.xml', '--keyframe', 'open'],
    async touch(page) {
      await page.keyboard.press('u');
      await page.evaluate(() => {
        fork1s.view.options.compliance = true;
        fork1s.view.restyle();
      });
      await seconds(1);
      const place = await page.evaluate(() => {
        const { view } = fork1s;
        const at = view.ellipsoids.drawn.findIndex((e) => view.scene.bodies[e.body].name === 'index_tip');
        const m = [...view.ellipsoids.mesh.instanceMatrix.array.slice(16 * at, 16 * at + 12)];
        const [long] = [0, 1, 2].map((i) => m.slice(4 * i, 4 * i + 3)).sort((a, b) => Math.hypot(...b) - Math.hypot(...a));
        const { width, height } = view.stage.renderer.domElement.getBoundingClientRect();
        const shown = (share) => {
          const p = view.ellipsoids.drawn[at].center.clone();
          p.set(p.x + share * long[0], p.y + share * long[1], p.z + share * long[2]).project(view.stage.camera);
          return [(0.5 + 0.5 * p.x) * width, (0.5 - 0.5 * p.y) * height];
        };
        return { from: shown(0.7), to: shown(2) };
      });
      await page.mouse.move(...place.from);
      await page.mouse.down(); // and it stays down
      await page.mouse.move(...place.to, { steps: 4 });
      await seconds(2);
    },
  },
  page_phone: {
    model: ['firemen.xml'],
    viewport: { width: 390, height: 844 },
    async touch() {
      await seconds(2);
    },
  },
  page_phone_dark: {
    model: grasp,
    viewport: { width: 390, height: 844 },
    colorScheme: 'dark',
    async touch(page) {
      await page.keyboard.press('p');
      await playUntil(page, 3);
      await look(page, -60, 14, 0.8, 'ball');
      await seconds(2);
    },
  },
};

function view(model) {
  const child = spawn(binary, ['view', join(scenes, model[0]), ...model.slice(1), '--no-open', '--port', '0', '--json']);
  return new Promise((done, fail) => {
    let text = '';
    child.stdout.on('data', (data) => {
      text += data;
      const found = /"address":"([^"]+)"/.exec(text);
      if (found) done({ address: found[1], stop: () => child.kill() });
    });
    child.once('exit', (code) => fail(new Error(`fork1s ended with ${code}`)));
  });
}

mkdirSync(folder, { recursive: true });
const browser = await chromium.launch({
  executablePath,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'],
});
for (const [name, picture] of Object.entries(pictures)) {
  if (only.length > 0 && !only.includes(name)) continue;
  const program = await view(picture.model);
  const page = await browser.newPage({
    viewport: picture.viewport ?? { width: 1280, height: 720 },
    colorScheme: picture.colorScheme ?? 'light',
  });
  await page.goto(program.address);
  await page.waitForFunction(() => globalThis.fork1s?.framesTaken > 2 && fork1s.view.framesDrawn > 2);
  await picture.touch(page);
  await page.screenshot({ path: join(folder, `${name}.png`) });
  await page.close();
  program.stop();
  process.stdout.write(`${join(folder, name)}.png\n`);
}
await browser.close();
