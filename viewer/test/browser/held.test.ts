// The level of detail that simulates what is held, alone: chosen in the page, seen in the page.
import { describe, expect, it } from 'vitest';
import { poseOf, ready, session, view } from './support';

describe.skipIf(!ready)('what a hand holds', () => {
  const live = session(() => view('peg_grasp.xml'));

  it('becomes the one interface body, with its contacts frozen and shown', async () => {
    const { page } = live;
    await page.waitForFunction(() => (fork1s?.scalar('time') ?? 0) > 1);
    const before = await poseOf(page, 'peg');
    const contacts = await page.evaluate(() => fork1s?.view.frame?.contacts.length ?? 0);
    expect(contacts).toBeGreaterThan(2);
    await page.keyboard.press('s');
    await page.locator('.lil-gui .controller', { hasText: 'detail level' }).locator('select').selectOption({ label: 'what it holds' });
    await page.waitForFunction(() => fork1s?.view.scene?.bodies.filter((b) => b.interface).every((b) => b.name === 'peg') === true);
    await page.waitForFunction(() => (fork1s?.view.frame?.epoch ?? 0) === fork1s?.view.scene?.epoch);
    const after = await poseOf(page, 'peg');
    expect(Math.hypot(...after.map((x, k) => x - (before[k] ?? NaN)))).toBeLessThan(1e-4);
    expect(await page.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(1e-6);
    // Where they were, and with about the force they had.
    expect(await page.evaluate(() => fork1s?.view.frame?.contacts.length ?? 0)).toBeGreaterThanOrEqual(contacts - 2);
    // Its shapes moved along with it to another place in the list of bodies.
    const shapes = await page.evaluate(() => {
      const peg = fork1s?.view.scene?.bodies.findIndex((b) => b.name === 'peg');
      return { peg, root: fork1s?.view.scene?.bodies[peg ?? -1]?.root, triangles: fork1s?.view.bodies.triangles };
    });
    expect(shapes.root).toBe(0);
    expect(shapes.triangles).toBeGreaterThan(1000);
  });

  it('is let go again by a reset, and the page says so', async () => {
    const { page } = live;
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('Backspace');
    await page.waitForFunction(() => fork1s?.view.scene?.bodies.some((b) => b.interface && b.name === 'index_tip') === true);
    const shown = page.locator('.lil-gui .controller', { hasText: 'detail level' }).locator('select');
    await expect.poll(() => shown.evaluate((s: HTMLSelectElement) => s.selectedOptions[0]?.label)).toBe('interface as given');
  });

  it('where nothing is held the page says why not', async () => {
    const { page } = live;
    await page.keyboard.press('Space');
    await page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    await page.keyboard.press('Backspace');
    await page.waitForFunction(() => fork1s?.scalar('steps') === 0);
    await page.evaluate(() => fork1s?.send({ type: 'set', setting: 'detail', value: 0 }));
    await page.locator('.problem', { hasText: 'holds nothing at present' }).waitFor();
  });
});
