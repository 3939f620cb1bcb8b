// Numbers at the body under the pointer, and colours by friction use.
import { expect, it } from 'vitest';
import { bodyFriction } from '../../src/scene/colouring';
import { hoverLines } from '../../src/ui/hover_label';
import type { Contact, Frame, SceneMessage, TunableInfo } from '../../src/wire/messages';

const body = (name: string, root: number) => ({ name, root, parent: root === 0 ? 0 : -1, interface: name === 'tip', mass: 0.5 });
const scene = {
  bodies: [body('tip', 0), body('ball', 1), body('wrist', 0)],
  joints: [
    { name: 'flex', body: 0, size: 1 },
    { name: 'ball', body: 2, size: 3 },
  ],
  controls: [{ name: 'servo', joints: [0] }],
} as unknown as SceneMessage;
const stiffness = (of: string, owner: string, value: number) => ({ of, owner, quantity: 'stiffness', value, unit: 'N·m/rad', original: value }) as TunableInfo;
const items = [stiffness('joint', 'flex', 2), stiffness('joint', 'ball.1', 3), stiffness('actuator', 'servo', 20), stiffness('actuator', 'other', 7)];
const contact = (a: number, b: number, force: [number, number, number]): Contact => ({ a, b, point: [0, 0, 0], normal: [0, 0, 1], force, gap: 0, friction: 0.5 });
// 6 N in all on the ball from the tip; the second contact slides.
const contacts = [contact(0, 1, [0, 0, 4]), contact(1, 0, [1, 0, -2]), contact(-1, 0, [0, 0, 3])];

it('are those of its contacts, joints and servos', () => {
  const frame = { contacts } as unknown as Frame;
  expect(hoverLines(scene, frame, 0, items)).toEqual([
    'tip (interface), 0.5 kg',
    'contact with ball: 6.08 N, 100 % of friction',
    'contact with world: 3.00 N, 0 % of friction',
    'joint flex: 2 N·m/rad',
    'servo servo: 20 N·m/rad',
  ]);
  expect(hoverLines(scene, frame, 2, items)).toEqual(['wrist, 0.5 kg', 'joint ball.1: 3 N·m/rad']);
  expect(hoverLines(scene, frame, -1, items)).toEqual([]);
});

it('colour each body by its contact nearest to sliding', () => {
  expect([...bodyFriction(scene, contacts)]).toEqual([1, 1, NaN]);
  expect([...bodyFriction(scene, [contact(0, 1, [1, 0, 4])])]).toEqual([0.5, 0.5, NaN]);
});
