import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, it } from 'vitest';
import { BINARY, open, poseOf, ready, running, screenOf, session, SOURCE, unseen, view } from './support';

describe.skipIf(!ready)('settings, picking and recordings', () => {
  const live = session(() => view('hand.xml', '--keyframe', 'open'));
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  afterAll(() => rmSync(folder, { recursive: true, force: true }));

  it('a slider moves the joint it names', async () => {
    const before = await poseOf(live.page, 'index_tip');
    await live.page.keyboard.press('s'); // the panel starts closed on small pages
    await live.page.locator('.lil-gui .title', { hasText: 'Set-points' }).click();
    const number = live.page.locator('.lil-gui .controller', { hasText: 'index_knuckle_flex' }).locator('input');
    await number.fill('0.2');
    await number.press('Enter');
    await live.page.waitForFunction(
      ([x, y, z]) => {
        const at = fork1s?.view.scene?.bodies.findIndex((b) => b.name === 'index_tip') ?? -1;
        const p = fork1s?.view.poses()[at]?.p ?? [0, 0, 0];
        return Math.hypot(p[0] - (x ?? 0), p[1] - (y ?? 0), p[2] - (z ?? 0)) > 0.01;
      },
      before,
    );
    await live.page.keyboard.press('Escape');
    await live.page.locator('canvas.stage').focus();
    await live.page.keyboard.press('s');
  });

  it('recovery is switched while it runs, and the page says how long that took', async () => {
    const epoch = await live.page.evaluate(() => fork1s?.view.scene?.epoch ?? 0);
    await live.page.evaluate(() => fork1s?.send({ type: 'set', setting: 'recovery', value: 1 }));
    await live.page.waitForFunction((n) => (fork1s?.view.scene?.epoch ?? 0) > n, epoch);
    expect(await live.page.evaluate(() => fork1s?.view.scene?.recovery)).toBe('twist');
    await live.page.waitForFunction(() => /reduced in [\d.e-]+ ms/.test(document.querySelector('.title p')?.textContent ?? ''));
    expect(await live.page.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(1e-6);
    await live.page.evaluate(() => fork1s?.send({ type: 'set', setting: 'recovery', value: 0 }));
    await live.page.waitForFunction(() => fork1s?.view.scene?.recovery === 'exact');
  });

  it('interface bodies are picked by clicking', async () => {
    await live.page.locator('canvas.stage').focus();
    await live.page.keyboard.press('Backspace');
    await live.page.keyboard.press('Space');
    // Between two pictures: a body is clicked where this frame has it, which may not have been drawn yet.
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === true, undefined, { polling: 20 });
    await live.page.keyboard.press('i');
    const at = await screenOf(live.page, 'index_proximal', [0.03, 0, 0]);
    await live.page.mouse.click(at.x, at.y);
    await live.page.waitForFunction(() => /index_(proximal|middle)/.test(document.querySelector('.pick p')?.textContent ?? ''));
    await live.page.getByText('Reduce to these').click();
    await live.page.waitForFunction(
      () => fork1s?.view.scene?.bodies.some((b) => b.interface && /index_(proximal|middle)/.test(b.name)) === true,
    );
    await live.page.keyboard.press('Space');
  });

  it('records, scrubs and goes back', async () => {
    await live.page.locator('canvas.stage').focus();
    await live.page.keyboard.press('r');
    await live.page.waitForFunction(() => (fork1s?.recorder.frames ?? 0) > 30);
    await live.page.keyboard.press('r');
    const slider = live.page.locator('.timeline input');
    await slider.waitFor();
    await slider.fill('5');
    await live.page.waitForFunction(() => fork1s?.timeline?.at === 5 && !fork1s.timeline.playing);
    const early = await live.page.evaluate(() => fork1s?.scalar('time') ?? 0);
    await slider.fill('25');
    const late = await live.page.evaluate(() => fork1s?.scalar('time') ?? 0);
    expect(late).toBeGreaterThan(early);
    const download = live.page.waitForEvent('download');
    await live.page.getByLabel('Save as one HTML file').click();
    const file = join(folder, 'saved.html');
    await (await download).saveAs(file);
    await live.page.getByText('Live', { exact: true }).click();
    await live.page.waitForFunction((t) => (fork1s?.scalar('time') ?? 0) > t + 0.4, late);
    await unseen(live.page, () => plays(file));
  });

  async function plays(file: string): Promise<void> {
    const replay = await open(live.browser, `file://${file}`);
    await running(replay);
    await replay.waitForFunction(() => (fork1s?.timeline?.at ?? 0) > 1);
    expect(await replay.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(1e-6);
    await replay.locator('.cover').waitFor({ state: 'hidden' });
    await replay.close();
  }

  for (const mode of ['exact', 'twist'])
    it(`a recording on disk becomes a page that plays without a server, ${mode}`, async () => {
      const recording = join(folder, `${mode}.h5`);
      const file = join(folder, `${mode}.html`);
      const scene = join(SOURCE, 'scenes', 'hand.xml');
      execFileSync(BINARY, ['run', scene, '--keyframe', 'open', '--time', '0.5', '--recovery', mode, '--record', recording], {
        stdio: 'ignore',
      });
      execFileSync(BINARY, ['export', recording, file], { stdio: 'ignore' });
      await unseen(live.page, () => plays(file));
    });

  it('a recording on disk has the signals that it knows, all of them at once', async () => {
    const replay = await open(live.browser, `file://${join(folder, 'exact.html')}`);
    await running(replay);
    await replay.keyboard.press('l');
    await replay.keyboard.press('p');
    await replay.waitForFunction(() => Math.abs((fork1s?.store.end ?? 0) - 0.5) < 0.02);
    await replay.locator('.signal').first().waitFor();
    const rows = await replay.locator('.signal').evaluateAll((all) => all.map((row) => [(row as HTMLElement).dataset['key'], row.querySelector('.unit')?.textContent]));
    const keys = rows.map(([key]) => key);
    for (const key of ['contact_force', 'energy', 'joint_gap', 'at:index_tip.z', 'q:index_knuckle_flex']) expect(keys).toContain(key);
    for (const key of ['real_time_factor', 'step_us', 'reduce_ms', 'error', 'load_factor', 'tip']) expect(keys).not.toContain(key);
    expect(rows.find(([key]) => key === 'q:index_knuckle_flex')?.[1]).toBe('rad');
    expect(await replay.evaluate(() => fork1s?.plots.signals.flat().includes('step_us'))).toBe(false);
    expect(await replay.evaluate(() => fork1s?.store.together('at:index_tip.z'))).toEqual(['at:index_tip.z']); // no other recovery
    await replay.close();
  });

  it('says so when the program has gone, and comes back by itself', async () => {
    const port = new URL(live.program.address).port;
    await live.program.stop();
    await live.page.waitForFunction(() => document.querySelector('.cover')?.textContent?.includes('No connection') === true);
    live.program = await view('hand.xml', '--port', port, '--no-token');
    await live.page.waitForFunction(() => document.querySelector<HTMLElement>('.cover')?.hidden === true);
    await running(live.page);
  });
});
