// What goes wrong is a sentence in the page, and the model before goes on.
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { afterAll, describe, expect, it } from 'vitest';
import { ready, running, session, view } from './support';

// The wheel turns freely: with the wheel as interface that is a coordinate, with the arm alone nobody sees it.
const arm = (wheel: string, more = ''): string => `<mujoco model="arm">
  <custom><text name="fork1s_interface" data="wheel"/></custom>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" stiffness="100" damping="1"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
      <body name="lower" pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" stiffness="100" damping="1"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03"/>
        <body name="wheel" pos="0.4 0 0">
          <joint name="axle" axis="1 0 0" ${wheel}/>
          <geom type="cylinder" size="0.1 0.02" euler="0 90 0"/>
          ${more}
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>`;

const text = (page: Page, about: string): Promise<string> =>
  page.locator(`.problem[data-about=${about}] p`).innerText({ timeout: 30_000 });

async function goesOn(page: Page): Promise<void> {
  const time = await page.evaluate(() => fork1s?.scalar('time') ?? NaN);
  await page.waitForFunction((t) => (fork1s?.scalar('time') ?? 0) > t + 0.2, time);
}

describe.skipIf(!ready)('a model that cannot be simulated', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const file = join(folder, 'arm.xml');
  writeFileSync(file, arm(''));
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file));

  it('after a change in the page: the whole sentence, and the model as it was', async () => {
    const { page } = live;
    const epoch = await page.evaluate(() => fork1s?.view.scene?.epoch);
    await page.evaluate(() => {
      const body = fork1s?.view.scene?.bodies.findIndex((b) => b.name === 'upper') ?? -1;
      fork1s?.send({ type: 'interfaces', mechanism: 0, bodies: [body] });
    });
    const sentence = await text(page, 'request');
    expect(sentence).toContain('axle'); // the joint at fault
    expect(sentence).toContain('stiffness'); // what to do
    await goesOn(page);
    expect(await page.evaluate(() => fork1s?.view.scene?.epoch)).toBe(epoch);
    expect(await page.evaluate(() => fork1s?.view.scene?.bodies.find((b) => b.interface)?.name)).toBe('wheel');
    expect(await text(page, 'request')).toBe(sentence); // it does not pass by itself
    // The next change that can be made takes it away.
    await page.evaluate(() => fork1s?.send({ type: 'set', setting: 'damping', value: 2 }));
    await page.waitForFunction(() => document.querySelector('.problem') === null);
  });

  it('a value out of range: the slider goes back', async () => {
    const { page } = live;
    await page.evaluate(() => fork1s?.send({ type: 'set', setting: 'dt', value: 5 }));
    expect(await text(page, 'request')).toContain('must lie between');
    await page.getByLabel('Close').click();
    expect(await page.locator('.problem').count()).toBe(0);
  });

  it('after an edit of the file: the sentence, until the file is good again', async () => {
    const { page } = live;
    writeFileSync(file, arm('stifness="5"'));
    const sentence = await text(page, 'file');
    expect(sentence).toContain('arm.xml');
    expect(sentence).toContain('stifness');
    await goesOn(page);
    writeFileSync(file, arm('stiffness="5"', '<geom name="hub" type="sphere" size="0.05"/>'));
    await page.waitForFunction(() => document.querySelector('.problem') === null);
    // The new file: four shapes in place of three, drawn where the program says they are.
    await page.waitForFunction(() => fork1s?.view.numShapes === 4);
    expect(await page.evaluate(() => fork1s?.view.poseError() ?? NaN)).toBeLessThan(1e-6);
    await running(page);
  });

  it('a page that comes later reads what is wrong with the file too', async () => {
    writeFileSync(file, '<mujoco>');
    const sentence = await text(live.page, 'file');
    await live.page.reload();
    await running(live.page);
    expect(await text(live.page, 'file')).toBe(sentence);
  });
});
