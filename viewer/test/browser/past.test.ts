// The last minute is there at any time; the simulation goes on from any of it, or keeps it in a copy of the file.
import { copyFileSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { open, poseOf, ready, session, SOURCE, start, unseen, view, withoutPicture } from './support';

describe.skipIf(!ready)('the past, and every signal', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const file = join(folder, 'hand.xml');
  copyFileSync(join(SOURCE, 'scenes', 'hand.xml'), file);
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file, '--keyframe', 'open'));
  const time = (): Promise<number> => live.page.evaluate(() => fork1s?.scalar('time') ?? NaN);

  beforeAll(() => withoutPicture(live.page));

  it('is scrubbed without having been recorded, and gone on from', async () => {
    const { page } = live;
    await page.evaluate(() => {
      const at = fork1s?.view.scene?.controls.findIndex((c) => c.name === 'index_knuckle_flex') ?? -1;
      fork1s?.send({ type: 'set', setting: 'control', index: at, value: 0.8 });
    });
    await page.keyboard.press('p');
    await page.waitForFunction(() => (fork1s?.scalar('time') ?? 0) > 1.2);
    await page.keyboard.press('ArrowLeft');
    await page.locator('.timeline').waitFor();
    await page.waitForFunction(() => fork1s?.timeline?.playing === false);
    const end = await time();
    // In the middle: a machine under load shows fewer frames a second, so that no number of a frame is a time.
    const slider = page.locator('.timeline input');
    await slider.fill(String(Math.floor(Number(await slider.getAttribute('max')) / 2)));
    await expect.poll(time).toBeLessThan(end - 0.2);
    const then = await time();
    // The plots hold what they had, with a line at the moment shown.
    expect(await page.evaluate(() => [fork1s?.store.end, fork1s?.store.playhead])).toEqual([end, then]);
    await page.waitForFunction(() => {
      const canvas = document.querySelector<HTMLCanvasElement>('.plot:nth-of-type(2) canvas');
      const pixels = canvas?.getContext('2d')?.getImageData(0, 0, canvas.width, canvas.height).data ?? [];
      let blue = 0;
      for (let i = 0; i < pixels.length; i += 4) if ((pixels[i + 2] ?? 0) > (pixels[i] ?? 0) + 60 && (pixels[i + 3] ?? 0) > 100) ++blue;
      return blue > 50;
    });
    const tip = await poseOf(page, 'index_tip');
    await page.getByRole('button', { name: 'Resume here' }).click();
    await page.keyboard.press('p');
    await page.waitForFunction((t) => fork1s?.timeline === null && (fork1s.scalar('time') ?? Infinity) < t, end);
    // Ten moments a second are kept: what comes first is the one shown or just before it.
    const first = await time();
    expect(first).toBeGreaterThan(then - 0.15);
    const now = await poseOf(page, 'index_tip');
    expect(Math.hypot(...now.map((x, k) => x - (tip[k] ?? NaN)))).toBeLessThan(0.1);
    await page.waitForFunction((t) => (fork1s?.scalar('time') ?? 0) > t, first + 0.2);
  });

  // Frames from before it went on were taken for a pause of the user's, and looking back a second time ended in one.
  it('is left and looked at again at once, and the simulation goes on in the end', async () => {
    const { page } = live;
    await page.evaluate(() => {
      const back = (): boolean => window.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' }));
      const leave = (): void => [...document.querySelectorAll('button')].find((b) => b.textContent === 'Live')?.click();
      back();
      leave();
      if (fork1s?.view.frame) fork1s.view.frame = { ...fork1s.view.frame, paused: true };
      back();
      leave();
    });
    const left = await time();
    await page.waitForFunction((t) => fork1s?.view.frame?.paused === false && fork1s.timeline === null && fork1s.scalar('time') > t + 0.2, left);
  });

  it('a moment is kept as keyframe text and in a copy that starts there', async () => {
    const { page } = live;
    await page.keyboard.press('Space');
    await page.waitForFunction(() => fork1s?.view.frame?.paused === true);
    const tip = await poseOf(page, 'index_tip');
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('k');
    const text = page.getByLabel('Keyframe text');
    await expect.poll(() => text.inputValue()).toMatch(/^<key name="kept" time="[\d.]+" qpos="[-\d. e]+" qvel="[-\d. e]+" ctrl="[-\d. e]+"/);
    await page.getByRole('button', { name: 'Write into a copy of my file' }).click();
    await page.waitForFunction(() => document.querySelector('.dialog .result')?.textContent?.includes('hand_tuned.xml') === true);
    await page.keyboard.press('Escape');
    expect(readFileSync(join(folder, 'hand_tuned.xml'), 'utf8')).toContain('<keyframe>');
    const other = await start('view', join(folder, 'hand_tuned.xml'), '--keyframe', 'kept', '--no-open', '--port', '0');
    const startsThere = async (): Promise<void> => {
      const second = await open(live.browser, other.address);
      await second.waitForFunction(() => (fork1s?.framesTaken ?? 0) > 0);
      await second.evaluate(() => fork1s?.send({ type: 'pause', on: true }));
      await second.waitForFunction(() => fork1s?.view.frame?.paused === true);
      await second.evaluate(() => fork1s?.send({ type: 'reset' }));
      await second.waitForFunction(() => fork1s?.scalar('steps') === 0);
      const there = await poseOf(second, 'index_tip');
      expect(Math.hypot(...there.map((x, k) => x - (tip[k] ?? NaN)))).toBeLessThan(1e-6);
      await second.close();
    };
    try {
      await unseen(page, startsThere);
    } finally {
      await other.stop();
    }
  });

  it('every signal is in the list; one goes into a plot by a click, over another by dragging', async () => {
    const { page } = live;
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('Space');
    await page.keyboard.press('l');
    await page.waitForFunction(() => document.querySelectorAll('.signal').length > 20);
    const keys = await page.locator('.signal').evaluateAll((rows) => rows.map((row) => (row as HTMLElement).dataset['key'] ?? ''));
    for (const key of ['step_us', 'kinetic_energy', 'error', 'load_factor', 'q:index_knuckle_flex', 'tau:index_knuckle_flex', 'f:index_knuckle_flex'])
      expect(keys).toContain(key);
    expect(keys.some((key) => key.startsWith('contact:'))).toBe(true);
    await page.locator('.signal[data-key="tau:index_knuckle_flex"]').click();
    const plots = (): Promise<readonly (readonly string[])[]> => page.evaluate(() => fork1s?.plots.signals ?? []);
    expect((await plots()).at(-1)).toEqual(['tau:index_knuckle_flex']);
    await page.evaluate(() => {
      const data = new DataTransfer();
      data.setData('text/x-fork1s-signal', 'f:index_knuckle_flex');
      document.querySelector('.plot:last-of-type')?.dispatchEvent(new DragEvent('drop', { dataTransfer: data, bubbles: true, cancelable: true }));
    });
    expect((await plots()).at(-1)).toEqual(['tau:index_knuckle_flex', 'f:index_knuckle_flex']);
    // The servo's law, from the same frame: F = kp (u - q) - kv dq/dt, nearly at rest.
    await page.waitForFunction(() => Number.isFinite(fork1s?.store.now('f:index_knuckle_flex') ?? NaN));
    // The sum of what acts on the joint is in balance with nothing but its weight.
    expect(await page.evaluate(() => Math.abs(fork1s?.store.now('f:index_knuckle_flex') ?? NaN))).toBeLessThan(5);
    const csv = await page.evaluate(() => fork1s?.store.csv() ?? '');
    const [head = '', ...rows] = csv.trim().split('\n');
    expect(head.split(',').length).toBeGreaterThan(60);
    expect(rows.length).toBeGreaterThan(10);
    for (const row of rows) expect(row.split(',').length).toBe(head.split(',').length); // no decimal commas
    expect(rows.at(-1)).toMatch(/^\d+(\.\d+)?,/);
  });

  it('the estimated error stands beside the clock and colours bodies; an accuracy is kept by smaller steps', async () => {
    const { page } = live;
    await page.getByLabel('estimate the error').check();
    await page.waitForFunction(() => /± .* mm/.test(document.querySelector('.title p')?.textContent ?? ''));
    await page.evaluate(() => {
      if (!fork1s) return;
      fork1s.view.options.colouring = 'error';
      fork1s.view.restyle();
      const at = fork1s.view.scene?.controls.findIndex((c) => c.name === 'index_knuckle_flex') ?? -1;
      fork1s.send({ type: 'set', setting: 'accuracy', value: 1e-5 });
      fork1s.send({ type: 'set', setting: 'control', index: at, value: 0.1 });
    });
    await page.locator('.legend', { hasText: 'estimated error' }).waitFor();
    await page.locator('.notice', { hasText: 'for 0.01 mm: ' }).first().waitFor();
  });
});
