// The model as a tree: what is chosen there is lit up in the scene, and the other way round.
import { describe, expect, it } from 'vitest';
import { ready, screenOf, session, view } from './support';

describe.skipIf(!ready)('the model tree', () => {
  const live = session(() => view('grasp_sphere.xml'));
  const row = (name: string) => live.page.locator('.tree .row.body', { hasText: name }).first();
  const selected = (): Promise<string | null> => live.page.evaluate(() => fork1s?.view.selected ?? null);

  it('lists bodies with their joints, actuators and shapes', async () => {
    const { page } = live;
    await page.keyboard.press('Space');
    await page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    await page.keyboard.press('m');
    await page.getByRole('tree').waitFor();
    const names = await page.evaluate(() => fork1s?.view.scene?.bodies.map((b) => b.name) ?? []);
    await page.getByRole('searchbox').fill('index_');
    const found = await page.locator('.tree .row').allTextContents();
    expect(found.filter((t) => t.startsWith('index_')).length).toBe(found.length);
    expect(found.length).toBeGreaterThan(names.filter((n) => n.startsWith('index_')).length); // joints and actuators too
    expect(found.some((t) => t.includes('actuator'))).toBe(true);
    await page.getByRole('searchbox').fill('');
  });

  it('a click in the scene chooses, in place of pushing', async () => {
    const { page } = live;
    await page.locator('.side').evaluate((side) => ((side as HTMLElement).style.visibility = 'hidden')); // on so small a page it covers the ball
    const at = await screenOf(page, 'ball');
    await page.mouse.click(at.x, at.y);
    await page.locator('.side').evaluate((side) => ((side as HTMLElement).style.visibility = ''));
    expect(await selected()).not.toBe(null);
    const name = (await selected()) ?? '';
    expect(await row(name).getAttribute('aria-selected')).toBe('true');
    expect(await page.locator('.chosen h3').innerText()).toBe(name);
  });

  it('goes by the keyboard', async () => {
    const { page } = live;
    await page.locator('.tree .row').first().focus();
    await page.keyboard.press('Home');
    await page.keyboard.press('ArrowRight');
    await page.keyboard.press('ArrowDown');
    await page.keyboard.press('Enter');
    expect(await page.evaluate(() => document.activeElement?.getAttribute('role'))).toBe('treeitem');
    expect(await page.evaluate(() => fork1s?.view.frame?.paused)).toBe(true);
  });

  it('hides, isolates and fades bodies, in the picture and for the pointer', async () => {
    const { page } = live;
    const hit = (name: string): Promise<string | undefined> =>
      page.evaluate((wanted) => {
        if (!fork1s?.view.scene) return undefined;
        const { view } = fork1s;
        const { x, y } = fork1s.screenOf(view.scene?.bodies.findIndex((b) => b.name === wanted) ?? -1);
        view.draw();
        const found = view.bodies.picker.pick(view.stage.renderer, view.stage.camera, x, y);
        return view.scene?.bodies[found?.body ?? -1]?.name ?? '';
      }, name);
    const picture = (): Promise<string> =>
      page.evaluate(() => {
        fork1s?.view.draw();
        return fork1s?.view.stage.renderer.domElement.toDataURL() ?? '';
      });
    await page.evaluate(() => {
      const at = fork1s?.view.scene?.bodies.findIndex((b) => b.name === 'ball') ?? -1;
      fork1s?.bench.tree.choose(at);
      fork1s?.view.stage.lookFrom(undefined, 60, 3, fork1s.view.poses()[at]?.p);
    });
    const whole = await picture();
    await page.locator('.chosen').getByRole('button', { name: 'Isolate' }).click();
    expect(await hit('ball')).toBe('ball');
    const alone = await picture();
    expect(alone).not.toBe(whole);
    expect(await page.evaluate(() => fork1s?.view.visibility.isHidden('palm'))).toBe(true);
    await page.locator('.chosen input[type=range]').fill('0.5');
    expect(await picture()).not.toBe(alone);
    await page.locator('.chosen').getByRole('button', { name: 'Hide' }).click();
    expect(await hit('ball')).toBe('');
    await page.locator('.chosen').getByRole('button', { name: 'Show all' }).click();
    expect(await picture()).toBe(whole);
  });

  it('draws joint axes, centres of mass and boxes of inertia', async () => {
    const { page } = live;
    for (const name of ['joint axes', 'centres of mass', 'inertia boxes']) await page.getByLabel(name).check();
    const drawn = await page.evaluate(() => {
      fork1s?.view.draw();
      const scene = fork1s?.view.scene;
      return {
        counts: fork1s?.view.anatomy.counts,
        massive: scene?.bodies.filter((b) => b.mass > 0).length,
        coordinates: scene?.screws.length,
      };
    });
    expect(drawn.counts).toEqual({ axes: drawn.coordinates, centers: drawn.massive, boxes: drawn.massive, tendons: 0 });
    await page.getByLabel('shapes').selectOption('collision');
    expect(await page.evaluate(() => fork1s?.view.bodies.triangles ?? 0)).toBeGreaterThan(0);
    await page.getByLabel('shapes').selectOption('visual');
  });
});
