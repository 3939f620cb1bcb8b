// Nothing covers anything, whatever the size of the page and whatever is open.
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { open, ready, resize, running, screenOf, session, view, withoutPicture } from './support';

const SIZES = [
  [1280, 720],
  [1920, 1080],
  [390, 844],
  [844, 390],
] as const;

interface Box {
  name: string;
  left: number;
  top: number;
  right: number;
  bottom: number;
}

describe.skipIf(!ready)('composition', () => {
  const live = session(() => view('hand.xml', '--keyframe', 'open'));

  const boxes = (): Promise<Box[]> =>
    live.page.evaluate(() =>
      ['.title', '.head > .bar', '.side', '.legend', '.lil-gui.panel', '.plots', '.timeline'].flatMap((name) => {
        const box = document.querySelector(name)?.getBoundingClientRect();
        return box && box.width > 0 && box.height > 0
          ? [{ name, left: box.left, top: box.top, right: box.right, bottom: box.bottom }]
          : [];
      }),
    );

  function apart(found: Box[], width: number, height: number): void {
    for (const a of found) {
      expect(a.left, `${a.name} left`).toBeGreaterThanOrEqual(0);
      expect(a.top, `${a.name} top`).toBeGreaterThanOrEqual(0);
      expect(a.right, `${a.name} right`).toBeLessThanOrEqual(width);
      expect(a.bottom, `${a.name} bottom`).toBeLessThanOrEqual(height);
      for (const b of found) {
        const over = Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 && Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
        if (a !== b) expect(over, `${a.name} covers ${b.name} at ${width}x${height}`).toBe(false);
      }
    }
  }

  /** Text that is wider than the element that shows it, where the element does not say so by dots. */
  const clipped = (): Promise<string[]> =>
    live.page.evaluate(() =>
      [...document.querySelectorAll<HTMLElement>('.title p, .legend span, .timeline span, .signal .value, .decimal, .lil-gui .controller input')]
        .filter((e) => e.offsetParent !== null && e.scrollWidth > e.clientWidth + 1)
        .map((e) => `${e.className} ${e.textContent ?? ''}${e instanceof HTMLInputElement ? e.value : ''}`),
    );

  beforeAll(() => withoutPicture(live.page));

  for (const [width, height] of SIZES)
    it(`at ${width}x${height} with everything open`, async () => {
      const { page } = live;
      await resize(page, width, height);
      await page.locator('canvas.stage').focus();
      const isShown = (selector: string): Promise<boolean> => page.locator(selector).isVisible();
      if (!(await isShown('.plots'))) await page.keyboard.press('p');
      for (const tab of ['m', 'u', 'l']) {
        await page.keyboard.press(tab);
        await page.locator('.side').waitFor();
        apart(await boxes(), width, height);
        expect(await clipped()).toEqual([]);
      }
      // On a phone one of the two has room.
      const settings = page.locator('.lil-gui.panel');
      if (await settings.evaluate((panel) => panel.classList.contains('lil-closed') || panel.classList.contains('closed'))) await page.keyboard.press('s');
      await expect.poll(async () => (await settings.boundingBox())?.height ?? 0).toBeGreaterThan(100);
      apart(await boxes(), width, height);
      if (width > 640 && height > 500) expect(await isShown('.side')).toBe(true);
      else expect(await isShown('.side')).toBe(false);
      // All plots with their scales can be reached.
      const reach = await page.locator('.plots').evaluate((plots) => plots.scrollWidth <= plots.clientWidth + 1 || plots.scrollHeight > plots.clientHeight || getComputedStyle(plots).overflowX === 'auto');
      expect(reach).toBe(true);
      await page.keyboard.press('ArrowLeft');
      await page.locator('.timeline').waitFor();
      apart(await boxes(), width, height);
      expect(await clipped()).toEqual([]);
      await page.getByRole('button', { name: 'Live' }).click();
      await page.locator('.timeline').waitFor({ state: 'detached' });
    });

  for (const theme of ['light', 'dark'])
    it(`on a phone the first plots are seen whole, and text is legible, ${theme}`, async () => {
      const { page } = live;
      await resize(page, 390, 844);
      await page.locator('canvas.stage').focus();
      if (!(await page.locator('.plots').isVisible())) await page.keyboard.press('p');
      if ((await page.evaluate(() => document.documentElement.dataset['theme'])) !== theme) await page.keyboard.press('t');
      await page.locator('.plots').evaluate((plots) => plots.scrollTo(0, 0));
      await expect
        .poll(async () => {
          const plots = await page.locator('.plots').boundingBox();
          const plot = await page.locator('.plots .plot').first().boundingBox();
          return plots && plot ? plots.y + plots.height - plot.y - plot.height : NaN;
        })
        .toBeGreaterThanOrEqual(0);
      // Contrast of text against what lies under it, as WCAG 2 defines it; 4.5 is its level AA.
      const faint = await page.evaluate(() => {
        type Colour = [number, number, number, number];
        const read = (text: string): Colour => {
          const [r = 0, g = 0, b = 0, a = 1] = (text.match(/[\d.]+/g) ?? []).map(Number);
          return [r, g, b, a];
        };
        const over = (top: Colour, under: Colour): Colour => {
          const mix = (i: 0 | 1 | 2): number => top[3] * top[i] + (1 - top[3]) * under[i];
          return [mix(0), mix(1), mix(2), 1];
        };
        const ground = (e: Element | null): Colour =>
          e ? over(read(getComputedStyle(e).backgroundColor), ground(e.parentElement)) : document.documentElement.dataset['theme'] === 'dark' ? [0, 0, 0, 1] : [255, 255, 255, 1];
        const luminance = (c: Colour): number => {
          const linear = (v: number): number => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4);
          return 0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2]);
        };
        return [...document.querySelectorAll<HTMLElement>('.title *, .legend span, .plots .names span, .lil-gui .title')]
          .filter((e) => e.offsetParent !== null && e.textContent?.trim())
          .flatMap((e) => {
            const under = ground(e);
            const [dark = 0, bright = 0] = [luminance(over(read(getComputedStyle(e).color), under)), luminance(under)].sort((a, b) => a - b);
            const contrast = (bright + 0.05) / (dark + 0.05);
            return contrast < 4.5 ? [`${e.textContent} ${contrast.toFixed(2)}`] : [];
          });
      });
      expect(faint).toEqual([]);
    });

  const framed = [[1280, 720, 'every panel'], [390, 844, 'plots'], [844, 390, 'plots'], [844, 390, 'settings'], [390, 844, 'nothing']] as const;
  for (const [width, height, shown] of framed)
    it(`at ${width}x${height} the whole model is seen beside all panels, open: ${shown}`, async () => {
      const { page } = live;
      await resize(page, width, height);
      await page.evaluate(() => fork1s?.bench.side.close());
      await page.locator('canvas.stage').focus();
      const press = async (key: string, selector: string, on: boolean): Promise<void> => {
        if ((await page.locator(selector).evaluate((e) => e.getBoundingClientRect().height > 60)) !== on) await page.keyboard.press(key);
      };
      await press('p', '.plots', shown === 'plots' || shown === 'every panel');
      await press('s', '.lil-gui.panel', shown === 'settings' || shown === 'every panel');
      if (shown === 'every panel') await page.keyboard.press('m');
      await page.keyboard.press('f');
      await expect
        .poll(async () => {
          const places = await page.evaluate(() => fork1s?.view.scene?.bodies.map((b, i) => ({ name: b.name, ...(fork1s?.screenOf(i) ?? { x: NaN, y: NaN }) })) ?? []);
          const found = await boxes();
          return places.flatMap(({ name, x, y }) => found.filter((b) => x > b.left && x < b.right && y > b.top && y < b.bottom).map((b) => `${name} under ${b.name}`));
        })
        .toEqual([]);
    });

  it('the camera knows the size of plots as soon as they are shown, and when all are closed', async () => {
    const { page } = live;
    await resize(page, 1280, 720);
    await page.evaluate(() => fork1s?.bench.side.close());
    await page.locator('canvas.stage').focus();
    const place = (): Promise<unknown> => page.evaluate(() => JSON.stringify(fork1s?.view.stage.camera.view));
    const settled = async (): Promise<unknown> => {
      for (let last: unknown, now = await place(); ; last = now, now = await place()) {
        if (now === last) return now;
        await page.evaluate(() => new Promise((done) => setTimeout(done, 1000)));
      }
    };
    for (let i = 0; i < 2; ++i) {
      await page.keyboard.press('p');
      const shown = await settled();
      await page.keyboard.press('f');
      expect(await place()).toBe(shown);
    }
  });

  it('the camera stays where it is while lines of the legend come and go', async () => {
    const { page } = live;
    await resize(page, 390, 844);
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('f');
    const place = (): Promise<unknown> => page.evaluate(() => fork1s?.view.stage.camera.view);
    const before = await place();
    await page.evaluate(() => fork1s?.send({ type: 'pull', body: 0, point: [0, 0, 0], target: [0, 0, 1] }));
    await page.waitForFunction(() => document.querySelector('.legend')?.textContent?.includes('pull'));
    expect(await place()).toEqual(before);
    await page.evaluate(() => fork1s?.send({ type: 'release' }));
  });

  it('a window made smaller with everything open has panels apart, and of settings and left panel the one', async () => {
    const { page } = live;
    await resize(page, 1920, 1080);
    await page.locator('canvas.stage').focus();
    await page.evaluate(() => fork1s?.bench.side.shown || fork1s?.bench.side.toggle());
    if (!(await page.locator('.plots').isVisible())) await page.keyboard.press('p');
    const settings = (): Promise<number> => page.locator('.lil-gui.panel').evaluate((panel) => panel.getBoundingClientRect().height);
    if ((await settings()) < 60) await page.keyboard.press('s');
    await expect.poll(settings).toBeGreaterThan(100);
    for (const [width, height] of [[1000, 700], [899, 600], [641, 600], [640, 600], [640, 360], [500, 500], [390, 844]] as const) {
      await resize(page, width, height);
      if (width < 900) await expect.poll(settings).toBeLessThan(60);
      apart(await boxes(), width, height);
      expect(await clipped()).toEqual([]);
    }
  });

  it('the bar stays where it is whatever the numbers beside it', async () => {
    const { page } = live;
    await resize(page, 844, 390);
    const place = () => page.locator('.head > .bar').boundingBox();
    const before = await place();
    await page.locator('.title p').first().evaluate((line) => (line.textContent = '1 s'));
    expect(await place()).toEqual(before);
  });

  it('numbers of the settings show that they have the focus of the Tab key', async () => {
    const { page } = live;
    await resize(page, 1280, 720);
    await page.locator('canvas.stage').focus();
    if (!(await page.locator('.lil-gui.panel input').first().isVisible())) await page.keyboard.press('s');
    await page.locator('.lil-gui.panel select:visible').last().focus();
    await page.keyboard.press('Tab');
    const width = await page.evaluate(() => (document.activeElement?.matches('.lil-gui.panel input') ? getComputedStyle(document.activeElement).outlineWidth : 'elsewhere'));
    expect(width).toBe('2px');
  });

  it('on a phone fingers find targets of 40 pixels, and nothing covers anything', async () => {
    const { page: other } = live;
    live.page = await open(live.browser, live.program.address, { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
    const { page } = live;
    try {
      await running(page);
      await withoutPicture(page);
      await page.keyboard.press('p');
      for (const [width, height] of [[390, 844], [844, 390]] as const) {
        await resize(page, width, height);
        for (const tab of ['m', 'u', 'l']) {
          await page.keyboard.press(tab);
          const small = await page.evaluate(() =>
            [...document.querySelectorAll<HTMLElement>('button, [role=tab], .side input:not([type=checkbox]), .side select, .side label, .row, .lil-gui .title')]
              .map((e) => ({ text: `${e.className} ${e.title || (e.textContent ?? '')}`, box: e.getBoundingClientRect() }))
              .filter(({ box }) => box.width > 0 && Math.min(box.width, box.height) < 39.5)
              .map(({ text, box }) => `${text} ${box.width.toFixed(0)}x${box.height.toFixed(0)}`),
          );
          expect(small).toEqual([]);
          apart(await boxes(), width, height);
        }
      }
    } finally {
      live.page = other;
      await page.close();
    }
  });

  for (const [width, height] of SIZES)
    it(`at ${width}x${height} the card of keys lies within the page, over everything`, async () => {
      const { page } = live;
      await resize(page, width, height);
      await page.locator('canvas.stage').focus();
      await page.keyboard.press('?');
      const box = await page.locator('.help').boundingBox();
      expect(Math.min(box?.x ?? -1, box?.y ?? -1)).toBeGreaterThanOrEqual(0);
      expect((box?.x ?? NaN) + (box?.width ?? NaN)).toBeLessThanOrEqual(width);
      expect((box?.y ?? NaN) + (box?.height ?? NaN)).toBeLessThanOrEqual(height);
      const order = await page.evaluate(() => {
        const level = (selector: string): number => Number(getComputedStyle(document.querySelector(selector) ?? document.body).zIndex);
        return ['.legend', '.cover', '.hover', '.help'].map(level);
      });
      expect([...order].sort((a, b) => a - b)).toEqual(order);
      expect(new Set(order).size).toBe(4);
      await page.keyboard.press('Escape');
    });

  it('every control has a name, and the Tab key goes from the bar to the panels to the plots', async () => {
    const { page } = live;
    await resize(page, 1280, 720);
    if (!(await page.locator('.side').isVisible())) await page.keyboard.press('m');
    const nameless = await page.evaluate(() =>
      [...document.querySelectorAll<HTMLElement>('button, [role=tab], .side input, .side select, .timeline input')]
        .filter((e) => e.offsetParent !== null)
        .filter((e) => !(e.getAttribute('aria-label') ?? e.textContent)?.trim() && !(e as HTMLInputElement).labels?.[0]?.textContent?.trim())
        .map((e) => e.outerHTML.slice(0, 80)),
    );
    expect(nameless).toEqual([]);
    const order = await page.evaluate(() => {
      const all = [...document.querySelectorAll('canvas.stage, .head, .side, .lil-gui.panel, .plots')];
      return all.map((e) => (e.tagName === 'CANVAS' ? 'stage' : [...e.classList].find((c) => ['head', 'side', 'panel', 'plots'].includes(c))));
    });
    expect(order).toEqual(['stage', 'head', 'side', 'panel', 'plots']);
    for (const role of ['toolbar', 'tablist', 'tabpanel', 'region']) expect(await page.getByRole(role as 'toolbar').count()).toBeGreaterThan(0);
  });

  it('a decimal comma in a settings field is a point', async () => {
    const { page } = live;
    await page.locator('canvas.stage').focus();
    if (await page.locator('.lil-gui.panel').evaluate((panel) => panel.classList.contains('lil-closed') || panel.classList.contains('closed'))) await page.keyboard.press('s');
    await page.locator('.lil-gui .title', { hasText: 'Set-points' }).click();
    const field = page.locator('.lil-gui .controller', { hasText: 'index_knuckle_flex' }).locator('input');
    await field.fill('0,25');
    await field.press('Enter');
    await page.waitForFunction(() => {
      const scene = fork1s?.view.scene;
      const at = scene?.controls.findIndex((c) => c.name === 'index_knuckle_flex') ?? -1;
      return Math.abs((fork1s?.bench.settings?.controls[at] ?? NaN) - 0.25) < 0.005; // the slider has steps
    });
  });

  it('a pull shows its force within two frames of the stream', async () => {
    const { page } = live;
    await resize(page, 480, 320);
    await page.evaluate(() => fork1s?.bench.side.close());
    const frames = await page.evaluate(async () => {
      const app = fork1s;
      if (!app?.view.scene) return [];
      const body = app.view.scene.bodies.findIndex((b) => b.name === 'box');
      const counts: number[] = [];
      const take = app.take.bind(app);
      let since = -1; // frames that came since the request
      let shown: (() => void) | null = null;
      app.take = (data) => {
        const before = app.framesTaken;
        take(data);
        if (since < 0 || app.framesTaken === before) return;
        ++since;
        if ((app.view.frame?.pulls.length ?? 0) > 0) shown?.();
      };
      for (let i = 0; i < 9; ++i) {
        const X = app.view.poses()[body];
        await new Promise<void>((done) => {
          shown = done;
          since = 0;
          app.send({ type: 'pull', body, point: [0, 0, 0], target: [X?.p[0] ?? 0, X?.p[1] ?? 0, (X?.p[2] ?? 0) + 0.01] });
        });
        counts.push(since);
        since = -1;
        app.send({ type: 'release' });
        await new Promise((done) => setTimeout(done, 100));
      }
      app.take = take;
      return counts;
    });
    // A page drawn in software may have frames waiting while it draws: of nine the middle one.
    expect([...frames].sort((a, b) => a - b)[4]).toBeLessThanOrEqual(2);
  });
});

describe.skipIf(!ready)('composition of long names', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const long = (name: string): string => `${name}_${'of_an_assembly_'.repeat(8)}`;
  const joint = (name: string, axis: string): string => `<joint name="${long(name)}" axis="${axis}" stiffness="1" damping="0.1"/>`;
  const file = join(folder, `${long('model')}.xml`);
  writeFileSync(
    file,
    `<mujoco><worldbody><body name="base"><geom size="0.01"/><body name="${long('link')}">${joint('bend', '0 1 0')}${joint('turn', '0 0 1')}
      <geom type="box" size="0.1 0.1 0.1"/></body></body></worldbody></mujoco>`,
  );
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file));

  it('has the label beside the pointer within the page, and all text in it', async () => {
    const { page } = live;
    await resize(page, 844, 390);
    await page.keyboard.press('f');
    const { x, y } = await screenOf(page, long('link'));
    await page.mouse.move(x, y);
    const label = page.getByRole('tooltip');
    await label.waitFor();
    await expect.poll(() => label.innerText()).toContain(long('turn'));
    const box = await label.evaluate((e) => ({ ...(e.getBoundingClientRect().toJSON() as DOMRect), text: e.scrollWidth - e.clientWidth }));
    expect(box.text).toBe(0);
    expect(Math.min(box.left, box.top)).toBeGreaterThanOrEqual(0);
    expect(box.right).toBeLessThanOrEqual(844);
    expect(box.bottom).toBeLessThanOrEqual(390);
  });

  it('fits the page, whatever its size', async () => {
    const { page } = live;
    await withoutPicture(page);
    for (const [width, height] of SIZES) {
      await resize(page, width, height);
      for (const tab of ['m', 'u', 'l']) {
        await page.keyboard.press(tab);
        const wide = await page.evaluate(() =>
          [...document.querySelectorAll<HTMLElement>('.title, .side, .side .page, .numbers, .signals, .legend, .plots')]
            .filter((e) => e.scrollWidth > e.clientWidth + 1 || e.getBoundingClientRect().right > window.innerWidth)
            .map((e) => e.className),
        );
        expect(wide).toEqual([]);
      }
      await page.keyboard.press('l');
    }
  });
});
