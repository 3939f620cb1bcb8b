// Plots begin with what moves and bears, take two signals of two units, and are looked at closely by dragging.
import { beforeAll, describe, expect, it } from 'vitest';
import { ready, resize, running, session, view, withoutPicture } from './support';

describe.skipIf(!ready)('plots', () => {
  const live = session(() => view('hexapod.xml'));
  const plots = (): Promise<readonly (readonly string[])[]> => live.page.evaluate(() => fork1s?.plots.signals ?? []);

  beforeAll(async () => {
    await withoutPicture(live.page);
    await resize(live.page, 1280, 720);
    await live.page.keyboard.press('p');
    await live.page.locator('figure.plot').first().waitFor();
  });

  it('begin with joints, contact, the base and energy, and have values of all', async () => {
    const shown = await plots();
    expect(shown.map((keys) => keys[0]?.split(':')[0])).toEqual(['q', 'contact_force', 'friction_use', 'base', 'energy']);
    expect(shown[0]?.length).toBe(3);
    await live.page.waitForFunction((keys) => keys.every((key) => Number.isFinite(fork1s?.store.now(key) ?? NaN)), shown.flat());
    expect(await live.page.evaluate((key) => fork1s?.store.now(key) ?? NaN, shown[3]?.[0] ?? '')).toBeGreaterThan(10); // mm above the ground
  });

  it('of a page that is loaded again have values of all, too', async () => {
    await live.page.goto('about:blank');
    await new Promise((done) => setTimeout(done, 1000)); // frames for nobody
    await live.page.goto(live.program.address);
    await running(live.page);
    await withoutPicture(live.page);
    await live.page.keyboard.press('p');
    await live.page.waitForFunction(() => {
      const shown = fork1s?.plots.signals.flat() ?? [];
      return shown.length > 5 && shown.every((key) => Number.isFinite(fork1s?.store.now(key) ?? NaN));
    });
  });

  it('show the whole caption of three overlaid signals', async () => {
    const cut = await live.page.locator('figure.plot figcaption').evaluateAll((all) =>
      all.flatMap((caption) => {
        const room = caption.getBoundingClientRect();
        return [...caption.querySelectorAll<HTMLElement>('span')]
          .filter((span) => span.scrollWidth > span.clientWidth + 1 || span.getBoundingClientRect().right > room.right + 1)
          .map((span) => span.textContent);
      }),
    );
    expect(cut).toEqual([]);
  });

  it('are listed in that order, the numbers of the solver last', async () => {
    await live.page.keyboard.press('l');
    await live.page.locator('.signals h3').first().waitFor();
    const groups = await live.page.locator('.signals h3').allTextContents();
    expect(groups.slice(0, 3).map((text) => text.split(/[ :,]/)[0])).toEqual(['Joint', 'Contact', 'Heights']);
    expect(groups.slice(-2)).toEqual(['Accuracy', 'Run']);
  });

  it('take a second signal by a shift-click, with a scale of its own', async () => {
    const before = await plots();
    await live.page.getByPlaceholder('Find a signal').fill('contact force, sum');
    await live.page.locator('.signal[data-key="contact_force"]').click(); // its plot goes
    await live.page.locator('.signal[data-key="contact_force"]').click({ modifiers: ['Shift'] });
    const after = await plots();
    expect(after.length).toBe(before.length - 1);
    expect(after.at(-1)).toEqual(['energy', 'contact_force']);
    expect(await live.page.locator('figure.plot').last().locator('.u-axis').count()).toBe(3);
    await live.page.keyboard.press('Escape');
  });

  it('show the time that is dragged over, all of them, until a double click or escape', async () => {
    const { page } = live;
    const span = (): Promise<number[]> =>
      page.locator('figure.plot').first().evaluate(() => fork1s?.plots.span.slice() ?? []);
    const drag = async (): Promise<void> => {
      const box = await page.locator('figure.plot .u-over').first().boundingBox();
      if (!box) throw new Error('no plot');
      await page.mouse.move(box.x + 0.25 * box.width, box.y + 20);
      await page.mouse.down();
      await page.mouse.move(box.x + 0.5 * box.width, box.y + 22, { steps: 4 });
      await page.mouse.up();
    };
    await page.waitForFunction(() => (fork1s?.store.end ?? 0) > 2);
    for (const leave of ['double click', 'escape']) {
      const [from = NaN, to = NaN] = await span();
      await drag();
      const [a = NaN, b = NaN] = await span();
      expect(b - a).toBeLessThan(0.5 * (to - from));
      expect(a).toBeGreaterThan(from);
      await page.waitForTimeout(300);
      expect(await span()).toEqual([a, b]); // it does not move on
      if (leave === 'escape') await page.keyboard.press('Escape');
      else await page.locator('figure.plot .u-over').first().dblclick();
      expect((await span())[1]).toBeGreaterThan(b);
    }
  });

  it('grow with the window', async () => {
    const height = (): Promise<number> => live.page.locator('figure.plot .uplot').first().evaluate((plot) => plot.getBoundingClientRect().height);
    const before = await height();
    await resize(live.page, 1920, 1080);
    await expect.poll(height).toBeGreaterThan(1.3 * before);
  });
});
