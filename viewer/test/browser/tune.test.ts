// Numbers of the model changed while it runs, and kept in a copy of its file.
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { poseOf, ready, resize, screenOf, session, view, withoutPicture } from './support';

const ARM = `<mujoco model="arm">
  <!-- what a person wrote stays -->
  <custom><text name="fork1s_interface" data="lower"/></custom>
  <default><joint damping="0.5"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="0.7"/>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="0.5"/>
      <body name="lower" pos="0.3 0 0">
        <joint name="elbow" axis="0 1 0" stiffness="2"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03" mass="0.5"/>
        <body pos="0.3 0 0"><joint axis="0 1 0" stiffness="3"/><geom size="0.02" mass="0.1"/></body>
      </body>
    </body>
  </worldbody>
  <actuator><position name="servo" joint="shoulder" kp="20" ctrlrange="-1 1"/></actuator>
</mujoco>`;

describe.skipIf(!ready)('tuning', () => {
  const folder = mkdtempSync(join(tmpdir(), 'fork1s-viewer-'));
  const file = join(folder, 'arm.xml');
  writeFileSync(file, ARM);
  afterAll(() => rmSync(folder, { recursive: true, force: true }));
  const live = session(() => view(file));
  const field = (name: string) => live.page.getByLabel(name, { exact: true });

  beforeAll(() => withoutPicture(live.page));

  it('shows each number with its unit, servo and joint apart', async () => {
    const { page } = live;
    await page.keyboard.press('u');
    expect(await field('stiffness of actuator servo').inputValue()).toBe('20');
    expect(await field('stiffness of joint shoulder').inputValue()).toBe('0');
    expect(await field('stiffness of joint elbow').inputValue()).toBe('2');
    expect(await field('damping of joint elbow').inputValue()).toBe('0.5');
    expect(Number(await field('upper limit of joint shoulder').inputValue())).toBeCloseTo(Math.PI / 2, 4);
    expect(await field('mass of body upper').inputValue()).toBe('0.5');
    expect(await page.locator('.number .unit', { hasText: 'N·m·s/rad' }).count()).toBeGreaterThan(1);
  });

  it('changes the motion at once; a comma is a point', async () => {
    const { page } = live;
    const low = (await poseOf(page, 'lower'))[2] ?? NaN;
    await field('stiffness of actuator servo').fill('200,5');
    await field('stiffness of actuator servo').press('Enter');
    await page.waitForFunction(
      (z) => {
        const at = fork1s?.view.scene?.bodies.findIndex((b) => b.name === 'lower') ?? -1;
        return (fork1s?.view.poses()[at]?.p[2] ?? -Infinity) > z + 0.02; // the arm hangs less
      },
      low,
    );
    expect(await field('stiffness of actuator servo').inputValue()).toBe('200.5');
    expect(await page.locator('.number.changed').count()).toBe(1);
  });

  it('refuses what cannot be, and says why', async () => {
    const { page } = live;
    await field('mass of body upper').fill('-1');
    await field('mass of body upper').press('Enter');
    const sentence = page.locator('.problem[data-about=request] p');
    await sentence.waitFor();
    expect(await sentence.innerText()).toContain("mass of body 'upper'");
    await page.getByLabel('Close', { exact: true }).click();
  });

  it('writes them into a copy beside the file: nothing else of the text moves, and what found no place is said', async () => {
    const { page } = live;
    const put = async (name: string, value: string): Promise<void> => {
      await field(name).fill(value);
      await field(name).press('Enter');
      await page.locator('.number.changed', { has: field(name) }).waitFor();
    };
    await put('damping of joint elbow', '0.75');
    await put('upper limit of joint shoulder', '0.5');
    await put('mass of body upper', '0.6');
    await put('friction of world floor', '0.9');
    await put('friction of body lower', '0.4');
    const nameless = await page.evaluate(() => fork1s?.view.scene?.joints.find((j) => j.name !== 'shoulder' && j.name !== 'elbow')?.name ?? '');
    await put(`stiffness of joint ${nameless}`, '4');
    await page.getByRole('button', { name: 'Write these into a copy' }).click();
    const result = page.locator('.page.tune .result');
    await page.waitForFunction(() => document.querySelector('.page.tune .result')?.textContent?.includes('arm_tuned.xml') === true);
    expect(await result.locator('li').allInnerTexts()).toEqual([
      expect.stringContaining(nameless), // it has no name to be found by
      expect.stringContaining(nameless), // and so the copy has the old number
    ]);
    expect(readFileSync(file, 'utf8')).toBe(ARM);
    const copy = readFileSync(join(folder, 'arm_tuned.xml'), 'utf8');
    const changed = ARM.split('\n').filter((line) => !copy.includes(line));
    expect(changed.length).toBe(5); // and a line more, for the mass
    expect(copy).toContain('<!-- what a person wrote stays -->');
    expect(copy).toContain('kp="200.5"');
    expect(copy).toContain('<joint name="elbow" axis="0 1 0" stiffness="2" damping="0.75"/>');
    expect(copy).toMatch(/range="-90 28\.64788976"/);
    expect(copy).toMatch(/<body name="upper" pos="0 0 1">\s*<inertial pos="0\.15 0 0" mass="0\.6"/);
    // A second one takes another name.
    await page.getByRole('button', { name: 'Write these into a copy' }).click();
    await page.waitForFunction(() => document.querySelector('.page.tune .result')?.textContent?.includes('arm_tuned2.xml') === true);
  });

  it('an ellipsoid shows what was asked, reached and possible within a factor, and is undone', async () => {
    const { page } = live;
    const stiffness = (): Promise<number[]> =>
      Promise.all(['actuator servo', 'joint elbow'].map(async (of) => Number(await field(`stiffness of ${of}`).inputValue())));
    await field('stiffness of actuator servo').fill('20');
    await field('stiffness of actuator servo').press('Enter');
    await expect.poll(stiffness).toEqual([20, 2]);
    const before = await stiffness();
    // At rest: the ellipsoid is that of the pose.
    let z = Number.NaN;
    await expect
      .poll(
        async () => {
          const last = z;
          z = (await poseOf(page, 'lower'))[2] ?? Number.NaN;
          return Math.abs(z - last);
        },
        { interval: 200, timeout: 10000 },
      )
      .toBeLessThan(1e-5);
    await field('greatest factor on a stiffness').fill('2');
    await field('greatest factor on a stiffness').press('Enter');
    expect(await page.locator('.shape .bounds').innerText()).toContain('between 1/2 and 2 times');
    const undo = page.getByRole('button', { name: 'Undo the last drag' });
    expect(await undo.isDisabled()).toBe(true);
    await page.evaluate(() => {
      if (!fork1s) return;
      fork1s.view.options.compliance = true;
      fork1s.view.restyle();
    });
    await page.waitForFunction(() => (fork1s?.view.ellipsoids.drawn.length ?? 0) > 0);
    const { from, to } = await page.evaluate(() => {
      if (!fork1s) throw new Error('no page');
      const { view } = fork1s;
      const m = view.ellipsoids.mesh.instanceMatrix.array;
      const z = Math.max(Math.abs(m[2] ?? 0), Math.abs(m[6] ?? 0), Math.abs(m[10] ?? 0)); // they point along z
      const { width, height } = view.stage.renderer.domElement.getBoundingClientRect();
      const shown = (share: number): [number, number] => {
        const p = view.ellipsoids.drawn[0]?.center.clone();
        if (!p) throw new Error('no ellipsoid');
        p.setZ(p.z + share * z).project(view.stage.camera);
        return [(0.5 + 0.5 * p.x) * width, (0.5 - 0.5 * p.y) * height];
      };
      return { from: shown(0.7), to: shown(3) };
    });
    const label = page.getByRole('tooltip'); // of the body behind it
    await page.mouse.move(...from);
    await label.waitFor();
    await page.mouse.down();
    await page.mouse.move(...to, { steps: 4 });
    await label.waitFor({ state: 'hidden' });
    await page.mouse.up();
    await page.locator('.shape dl').waitFor();
    const numbers = async () => (await page.locator('.shape dl').innerText()).match(/[\d.]+(?:e[-+]\d+)?/g)?.map(Number) ?? [];
    // Twice as soft at most. Every move of the drag is answered; those of the last one stay.
    await expect.poll(async () => {
      const [asked = NaN, reached = NaN, , possible = NaN] = await numbers();
      return asked > possible && Math.abs(reached - possible) < 0.01 * possible ? 'reached' : await numbers();
    }).toBe('reached');
    expect((await stiffness())[0]).toBe(10);
    await undo.click();
    await expect.poll(stiffness).toEqual(before);
    expect(await undo.isDisabled()).toBe(true);
  });

  it('a body that passes through another is named, with the button that makes it an interface', async () => {
    const { page } = live;
    // The forearm swings down through the floor: only the hand was said to touch.
    writeFileSync(
      file,
      `<mujoco model="pass"><custom><text name="fork1s_interface" data="hand"/></custom><worldbody>
        <geom name="floor" type="plane" size="0 0 1"/>
        <body name="forearm" pos="0 0 0.25">
          <joint name="elbow" axis="0 1 0" stiffness="0.1" damping="0.3"/>
          <geom type="box" size="0.15 0.02 0.02" pos="0.15 0 0"/>
          <body name="hand" pos="0.1 0 0"><joint name="wrist" axis="0 1 0" stiffness="1" damping="0.1"/><geom type="box" size="0.02 0.02 0.02" pos="-0.1 0 0.1"/></body>
        </body></worldbody></mujoco>`,
    );
    const button = page.getByRole('button', { name: "Make 'forearm' an interface" });
    await button.waitFor();
    expect(await page.locator('.advice').innerText()).toMatch(/'forearm' passed [\d.]+ mm into 'world'/);
    expect(await button.evaluate((b) => getComputedStyle(b).fontSize)).toBe('13px');
    await resize(page, 1280, 720);
    await page.locator('canvas.stage').focus();
    await page.keyboard.press('f');
    const card = await page.locator('.advice .problem').boundingBox();
    const { x, y } = await screenOf(page, 'hand');
    expect(card && x > card.x && x < card.x + card.width && y > card.y && y < card.y + card.height).toBe(false);
    await button.click();
    await page.waitForFunction(() => fork1s?.view.scene?.bodies.find((b) => b.name === 'forearm')?.interface === true);
    await page.waitForFunction(() => (fork1s?.view.frame?.contacts.length ?? 0) > 0);
  });
});
