// The full simulation as a ghost beside the reduced one.
import { describe, expect, it } from 'vitest';
import { ready, resize, session, view } from './support';

describe.skipIf(!ready)('the full simulation as a ghost', () => {
  const live = session(() => view('hand.xml', '--keyframe', 'open'));

  it('a checkbox starts it, and the page says how far it is away', async () => {
    const { page } = live;
    await page.keyboard.press('s'); // the panel starts closed on small pages
    await page.locator('.lil-gui .title', { hasText: 'View' }).click();
    const box = page.locator('.lil-gui .controller', { hasText: 'full simulation' }).locator('input');
    expect(await box.isChecked()).toBe(false);
    await box.check();
    await page.waitForFunction(() => /full simulation: .*[\d.]+ mm away at \w+/.test(document.querySelector('.title p.ghost')?.textContent ?? ''));
    await page.waitForFunction(() => (fork1s?.view.fullFrame?.time ?? 0) > 0.1 && fork1s?.view.full.ghost.group.visible === true);
    await page.keyboard.press('Escape');
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('s');
  });

  it('one coordinate of a body is plotted by both recovery modes and by the full simulation', async () => {
    const { page } = live;
    await page.keyboard.press('l');
    await page.getByPlaceholder('Find a signal').fill('index_tip z');
    await page.locator('button.signal[data-key="at:index_tip.z"]').click();
    const figure = page.locator('figure.plot', { hasText: 'index_tip z [mm]' });
    expect(await figure.locator('figcaption span').allTextContents()).toEqual(['index_tip z [mm]', 'twist [mm]', 'full [mm]']);
    const told = await page.waitForFunction(() => {
      const store = fork1s?.store;
      const [, ...columns] = store?.columns(store.together('at:index_tip.z')) ?? [[]];
      const told = columns[2] ?? [];
      let at = told.length - 1; // the full simulation comes behind
      while (at >= 0 && told[at] === null) --at;
      const values = columns.map((column) => column[at] ?? NaN);
      return values.length === 3 && values.every(Number.isFinite) && values;
    });
    const [exact = NaN, twist = NaN, full = NaN] = (await told.jsonValue()) || [];
    expect(exact).toBeGreaterThan(10); // mm above the table
    expect(Math.abs(twist - exact)).toBeLessThan(1);
    expect(Math.abs(full - exact)).toBeLessThan(1);
    await page.keyboard.press('p');
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('l');
  });

  it('its bodies are drawn where it has them', async () => {
    const { page } = live;
    const apart = await page.evaluate(() => {
      const ghost = fork1s?.view.fullFrame;
      const poses = fork1s?.view.poses() ?? [];
      if (!ghost) return [NaN];
      return poses.map((X, b) => Math.hypot(...X.p.map((x, k) => x - (ghost.poses[7 * b + k] ?? NaN))));
    });
    expect(apart.length).toBeGreaterThan(10);
    expect(Math.max(...apart)).toBeLessThan(0.01); // both hang at rest; the distance shown is the exact one
    // Aside by a span it covers other pixels, and none once it is off.
    const pixels = (): Promise<string> =>
      page.evaluate(() => {
        if (!fork1s) return '';
        fork1s.view.restyle();
        fork1s.view.draw();
        return fork1s.view.stage.renderer.domElement.toDataURL();
      });
    await page.keyboard.press('Space');
    await page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    await page.waitForFunction(() => (fork1s?.view.fullFrame?.behind ?? 1) === 0);
    const over = await pixels();
    await page.evaluate(() => fork1s && (fork1s.view.options.ghostOffset = 0.2));
    const aside = await pixels();
    expect(aside).not.toBe(over);
    await page.evaluate(() => fork1s?.send({ type: 'ghost', on: false }));
    await page.waitForFunction(() => fork1s?.view.fullFrame === null);
    const without = await pixels();
    expect(without).not.toBe(aside);
    expect(without).not.toBe(over);
    await page.locator('.title p.ghost').waitFor({ state: 'hidden' });
    expect(await page.evaluate(() => fork1s?.view.full.ghost.group.visible)).toBe(false);
  });

  it('an ellipsoid of compliance is dragged, and stiffnesses of its finger follow', async () => {
    const { page } = live;
    await resize(page, 900, 560); // the panel leaves room for the hand
    await page.evaluate(() => fork1s?.send({ type: 'pause', on: false }));
    await page.keyboard.press('u');
    await page.evaluate(() => {
      if (!fork1s) return;
      fork1s.view.options.compliance = true;
      fork1s.view.restyle();
    });
    await page.waitForFunction(() => (fork1s?.view.ellipsoids.drawn.length ?? 0) > 0);
    // Along its longest axis: from seven tenths of it to twice that.
    const place = await page.evaluate(() => {
      const view = fork1s?.view;
      const at = view?.ellipsoids.drawn.findIndex((e) => view.scene?.bodies[e.body]?.name === 'index_tip') ?? -1;
      const one = view?.ellipsoids.drawn[at];
      if (!fork1s || !view || !one) throw new Error('no ellipsoid');
      const m = [...view.ellipsoids.mesh.instanceMatrix.array.slice(16 * at, 16 * at + 12)];
      const axes = [0, 1, 2].map((i) => m.slice(4 * i, 4 * i + 3));
      const [long = []] = axes.sort((a, b) => Math.hypot(...b) - Math.hypot(...a));
      const { width, height } = view.stage.renderer.domElement.getBoundingClientRect();
      const shown = (share: number): { x: number; y: number } => {
        const p = one.center.clone();
        p.set(p.x + share * (long[0] ?? 0), p.y + share * (long[1] ?? 0), p.z + share * (long[2] ?? 0)).project(view.stage.camera);
        return { x: (0.5 + 0.5 * p.x) * width, y: (0.5 - 0.5 * p.y) * height };
      };
      return { body: one.body, C: [...one.C], from: shown(0.7), to: shown(1.4) };
    });
    const changed = page.locator('.number.changed');
    expect(await changed.count()).toBe(0);
    const { mouse } = page;
    const grabbed = (): Promise<boolean> => page.evaluate(() => fork1s?.view.ellipsoids.wished.visible ?? false);
    await mouse.move(place.from.x, place.from.y);
    await mouse.down();
    await mouse.move(place.to.x, place.to.y, { steps: 3 });
    expect(await grabbed()).toBe(true);
    await changed.first().waitFor();
    await mouse.up();
    const names = await page.locator('.number.changed input').evaluateAll((fields) => fields.map((f) => f.getAttribute('aria-label') ?? ''));
    expect(names.length).toBeGreaterThan(0);
    expect(names.every((name) => /^stiffness of \w+ index_/.test(name))).toBe(true);
    // It gives way more than it did.
    await page.waitForFunction(({ body, C }) => {
      const now = fork1s?.view.ellipsoids.drawn.find((e) => e.body === body)?.C ?? [];
      const trace = (c: readonly number[]): number => (c[0] ?? 0) + (c[1] ?? 0) + (c[2] ?? 0);
      return trace(now) > 1.2 * trace(C);
    }, place);
    expect(await grabbed()).toBe(false);
  });
});
