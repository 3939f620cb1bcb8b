import { describe, expect, it } from 'vitest';
import { launch, open, poseOf, ready, running, screenOf, session, view } from './support';

const distance = (a: number[], b: number[]): number => Math.hypot(...a.map((x, i) => x - (b[i] ?? 0)));

describe.skipIf(!ready)('the page on a running hand', () => {
  const live = session(() => view('hand.xml', '--keyframe', 'open'));

  it('shows the model and its name', async () => {
    expect(await live.page.title()).toContain('hand.xml');
    await live.page.locator('.cover').waitFor({ state: 'hidden' });
    expect(await live.page.evaluate(() => fork1s?.view.bodies.triangles ?? 0)).toBeGreaterThan(1000);
  });

  it('computes on the GPU the poses of the double-precision reference', async () => {
    const error = await live.page.evaluate(() => fork1s?.view.poseError() ?? NaN);
    expect(error).toBeLessThan(1e-6);
  });

  it('pauses with space, steps with the right arrow, resets with backspace', async () => {
    await live.page.keyboard.press('Space');
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    const steps = await live.page.evaluate(() => fork1s?.scalar('steps') ?? 0);
    await live.page.keyboard.press('ArrowRight');
    await live.page.waitForFunction((n) => fork1s?.scalar('steps') === n + 1, steps);
    // A page that is opened now shows this moment.
    const second = await open(live.browser, live.program.address);
    await running(second);
    await second.locator('.cover').waitFor({ state: 'hidden' });
    expect(await second.evaluate(() => fork1s?.scalar('steps'))).toBe(steps + 1);
    await second.close();
    await live.page.keyboard.press('Backspace');
    await live.page.waitForFunction(() => fork1s?.scalar('steps') === 0);
    await live.page.keyboard.press('Space');
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === false && fork1s.scalar('steps') > 2);
  });

  it('a page opened while paused shows the present', async () => {
    await live.page.waitForFunction(() => (fork1s?.scalar('steps') ?? 0) > 10);
    await live.page.keyboard.press(' ');
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    const steps = await live.page.evaluate(() => fork1s?.scalar('steps'));
    const other = await open(live.browser, live.program.address);
    await other.waitForFunction((n) => fork1s?.scalar('steps') === n && fork1s?.view.frame?.paused === true && fork1s?.view.framesDrawn > 0, steps);
    expect(await poseOf(other, 'index_tip')).toEqual(await poseOf(live.page, 'index_tip'));
    await other.close();
    await live.page.keyboard.press(' ');
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === false);
  });

  it('drags an interior body, and the force shows', async () => {
    const point: [number, number, number] = [0.03, 0, 0];
    const before = await poseOf(live.page, 'index_middle');
    const at = await screenOf(live.page, 'index_proximal', point);
    await live.page.mouse.move(at.x, at.y);
    await live.page.mouse.down();
    await live.page.mouse.move(at.x + 60, at.y - 30, { steps: 4 });
    await live.page.waitForFunction(() => (fork1s?.view.frame?.pulls.length ?? 0) === 1);
    await live.page.waitForFunction(() => /\d N$/.test(document.querySelector('.force')?.textContent ?? ''));
    await live.page.waitForTimeout(500);
    const grabbed = await live.page.evaluate(() => fork1s?.view.scene?.bodies[fork1s.view.frame?.pulls[0]?.body ?? -1]);
    expect(grabbed?.interface).toBe(false);
    expect(distance(await poseOf(live.page, 'index_middle'), before)).toBeGreaterThan(1e-3);
    await live.page.mouse.up();
    await live.page.waitForFunction(() => fork1s?.view.frame?.pulls.length === 0);
    await live.page.locator('.force').waitFor({ state: 'hidden' });
  });

  it('pushes with a click', async () => {
    const at = await screenOf(live.page, 'box');
    await live.page.evaluate(() => {
      (globalThis as { pushes?: number }).pushes = 0;
      const app = fork1s;
      if (!app) return;
      const take = app.take.bind(app);
      app.take = (data) => {
        take(data);
        if ((app.view.frame?.pulls.length ?? 0) > 0) (globalThis as { pushes?: number }).pushes = 1;
      };
    });
    await live.page.mouse.click(at.x, at.y);
    await live.page.waitForFunction(() => (globalThis as { pushes?: number }).pushes === 1);
  });
});

describe.skipIf(!ready)('poses in both modes, with loops', () => {
  for (const [scene, mode] of [
    ['firemen.xml', 'exact'],
    ['firemen.xml', 'curved'],
    ['firemen.xml', 'twist'],
    ['hexapod.xml', 'exact'],
  ] as const)
    it(`${scene}, ${mode}`, async () => {
      const program = await view(scene, '--recovery', mode);
      const browser = await launch();
      try {
        const page = await open(browser, program.address);
        await running(page);
        expect(await page.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(1e-6);
      } finally {
        await browser.close();
        await program.stop();
      }
    });
});
