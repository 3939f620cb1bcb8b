// Bodies under the pointer: interface bodies chosen by clicking them, bodies without a joint of their own among
// them; what a label says of one; and the posture that servos hold.
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { ready, resize, screenOf, session, view } from './support';

const MODEL = `<mujoco model="fixed"><worldbody>
  <geom name="floor" type="plane" size="0 0 1"/>
  <body name="stand" pos="0 0 0.5"><geom type="box" size="0.1 0.1 0.02"/>
    <body name="plate" pos="0 0.3 0"><geom type="box" size="0.05 0.05 0.02"/></body>
    <body name="arm" pos="0.1 0 0"><joint name="hinge" axis="0 1 0" stiffness="2" damping="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/>
      <body name="hand" pos="0.3 0 0"><geom size="0.04"/><body name="nail" pos="0.1 0 0"><geom size="0.03"/></body></body>
    </body>
  </body>
</worldbody><actuator><position name="servo" joint="hinge" kp="30"/></actuator></mujoco>`;

describe.skipIf(!ready)('picking', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const file = join(folder, 'fixed.xml');
  writeFileSync(file, MODEL);
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file));
  const interfaces = (): Promise<string[]> => live.page.evaluate(() => fork1s?.view.scene?.bodies.filter((b) => b.interface).map((b) => b.name) ?? []);

  beforeAll(async () => {
    await resize(live.page, 800, 600);
    await live.page.keyboard.press(' ');
    await live.page.waitForFunction(() => fork1s?.view.frame?.paused === true);
  });

  it.each(['hand', 'plate'])('takes %s, which has no joint of its own', async (body) => {
    const { page } = live;
    await page.keyboard.press('i');
    await page.locator('.pick').waitFor();
    const at = await screenOf(page, body, [0, 0, 0.02]);
    await page.mouse.click(at.x, at.y);
    await expect.poll(() => page.locator('.pick p').innerText()).toContain(body);
    await page.getByRole('button', { name: 'Reduce to these' }).click();
    await expect.poll(interfaces).toContain(body);
  });

  it('tells the stiffness of the joint under the pointer, and no more beside it', async () => {
    const { page } = live;
    const at = await screenOf(page, 'arm', [0.15, 0, 0.01]);
    await page.mouse.move(at.x, at.y);
    const label = page.getByRole('tooltip');
    await expect.poll(() => label.innerText()).toContain('joint hinge: 2 N·m/rad');
    expect(await label.innerText()).toContain('servo servo: 30 N·m/rad');
    await page.mouse.move(10, 590);
    await label.waitFor({ state: 'hidden' });
  });

  it('colours bodies that touch by friction use', async () => {
    const { page } = live;
    await page.keyboard.press('s');
    await page.locator('.lil-gui .lil-gui .title', { hasText: 'View' }).click();
    await page.locator('.lil-gui .controller', { hasText: 'colouring' }).locator('select').selectOption('friction in use');
    await page.locator('.legend').getByText('friction in use 0 to 100 %').waitFor();
  });

  it('holds the present posture by its servos', async () => {
    const { page } = live;
    await page.keyboard.press(' ');
    await page.waitForFunction(() => (fork1s?.scalar('time') ?? 0) > 1);
    await page.keyboard.press(' ');
    await page.locator('.lil-gui .lil-gui .title', { hasText: 'Set-points' }).click();
    await page.getByRole('button', { name: 'Hold this posture' }).click();
    // The arm hangs lower than its set-point of 0 was.
    await page.waitForFunction(() => (fork1s?.bench.settings?.controls[0] ?? 0) > 0.01);
  });
});
