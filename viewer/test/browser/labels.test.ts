// Words and numbers around the picture.
import { beforeAll, describe, expect, it } from 'vitest';
import { ready, resize, session, view } from './support';

describe.skipIf(!ready)('labels', () => {
  const live = session(() => view('grasp_sphere.xml'));

  beforeAll(async () => {
    await resize(live.page, 1280, 720);
    for (const key of ['s', 'm', 'p']) await live.page.keyboard.press(key);
    await live.page.locator('figure.plot').first().waitFor();
  });

  it('name the groups of the toolbar where there is room', async () => {
    const names = live.page.locator('.head .group .name');
    expect(await names.allTextContents()).toEqual(['Simulation', 'Keep', 'Model', 'View']);
    for (let i = 0; i < 4; ++i) expect(await names.nth(i).isVisible()).toBe(true);
    await resize(live.page, 390, 844);
    expect(await names.first().isVisible()).toBe(false);
    const tops = await live.page.locator('.head .bar button').evaluateAll((all) => all.map((b) => b.getBoundingClientRect().top));
    expect(new Set(tops).size).toBe(1); // "?" stands beside the rest
    await resize(live.page, 1280, 720);
    await live.page.keyboard.press('s'); // there was room for one of the two panels
  });

  it('stand on every control of bar, settings, tabs and plots as a tooltip', async () => {
    const without = await live.page
      .locator('.bar button, [role=tab], .lil-gui .controller, .plot button, .plot figcaption span')
      .evaluateAll((all) => all.filter((e) => (e as HTMLElement).title === '' && !/reduced to/.test(e.textContent)).map((e) => e.outerHTML.slice(0, 100)));
    expect(without).toEqual([]);
  });

  it('of the legend explain everything that has a colour, and the length of arrows', async () => {
    await live.page.evaluate(() => {
      if (!fork1s) return;
      Object.assign(fork1s.view.options, { colouring: 'roles', cones: true, axes: true, centers: true, inertia: true, frames: true, reference: true });
      fork1s.view.restyle();
    });
    const legend = live.page.locator('.legend');
    for (const word of ['interface', 'interior', 'free', 'friction cone', 'hinge axis', 'centre of mass', 'box of inertia', 'x', 'y', 'z', 'reference pose'])
      await legend.getByText(word, { exact: true }).waitFor();
    await legend.getByText(/^contact force: arrow [\d.]+ mm = [\d.]+ N$/).waitFor();
  });

  it('of numbers have no digits that say nothing, and off where a setting is', async () => {
    const value = (name: string): Promise<string> => live.page.locator('.lil-gui .controller', { hasText: name }).locator('input').first().inputValue();
    await expect.poll(() => value('accuracy [mm]')).toBe('off');
    await expect.poll(() => value('modes')).toMatch(/^\d+$/);
    await expect.poll(() => value('damping')).toBe('1');
    await expect.poll(() => value('dt [s]')).toBe('0.0167');
    const field = live.page.locator('.lil-gui .controller', { hasText: 'friction ×' }).locator('input');
    await field.fill('0');
    await field.press('Enter');
    await expect.poll(() => value('friction ×')).toBe('off');
    await live.page.waitForFunction(() => fork1s?.bench.settings?.friction === 0);
  });

  it('of a recording have no separator before the first group of the toolbar', async () => {
    const { page } = live;
    await resize(page, 1280, 720);
    await page.keyboard.press('r');
    await page.waitForTimeout(500);
    await page.keyboard.press('r');
    await page.locator('.timeline').waitFor();
    const groups = await page.locator('.head .group').evaluateAll((all) =>
      all.filter((g) => g.checkVisibility()).map((g) => [g.ariaLabel, parseFloat(getComputedStyle(g).borderLeftWidth)]),
    );
    expect(groups).toEqual([
      ['Model', 0],
      ['View', 1],
    ]);
  });
});
