// What the body under the pointer is, what holds its joints and what presses on it, beside the pointer.
import { frictionUse } from '../scene/colouring';
import type { Frame, SceneMessage, TunableInfo } from '../wire/messages';
import { element, shortUnit, withUnit } from './dom';

const MOST_LINES = 8;
const GAP = 16; // to the pointer [pixels]

/** Stiffness of every joint of a body and of the servos on it, as they are tuned now. */
function stiffnessLines(scene: SceneMessage, body: number, items: readonly TunableInfo[]): string[] {
  return scene.joints.flatMap((joint, j) => {
    if (joint.body !== body) return [];
    const servos = scene.controls.filter((c) => c.joints.includes(j)).map((c) => c.name);
    const ofJoint = (owner: string): boolean => owner === joint.name || owner.startsWith(`${joint.name}.`);
    return items.flatMap(({ of, owner, quantity, value, unit }) => {
      if (quantity !== 'stiffness' || !value) return [];
      if (of === 'joint' && ofJoint(owner)) return [`joint ${owner}: ${shortUnit(value, unit)}`];
      return of === 'actuator' && servos.includes(owner) ? [`servo ${owner}: ${shortUnit(value, unit)}`] : [];
    });
  });
}

/** Of each body that presses on this one: the size of the sum of forces, and the largest friction use. */
function contactLines(scene: SceneMessage, frame: Frame, body: number): string[] {
  const others = new Map<number, { force: [number, number, number]; use: number }>();
  for (const c of frame.contacts) {
    if (c.a !== body && c.b !== body) continue;
    const other = c.a === body ? c.b : c.a;
    const s = c.a === body ? -1 : 1;
    const { force, use } = others.get(other) ?? { force: [0, 0, 0], use: 0 };
    others.set(other, {
      force: [force[0] + s * c.force[0], force[1] + s * c.force[1], force[2] + s * c.force[2]],
      use: Math.max(use, frictionUse(c)),
    });
  }
  return [...others].map(
    ([other, { force, use }]) =>
      `contact with ${scene.bodies[other]?.name ?? 'world'}: ${withUnit(Math.hypot(...force), 'N')}, ${(100 * use).toFixed(0)} % of friction`,
  );
}

export function hoverLines(scene: SceneMessage, frame: Frame, body: number, items: readonly TunableInfo[]): string[] {
  const info = scene.bodies[body];
  if (!info) return [];
  const lines = [
    `${info.name}${info.interface ? ' (interface)' : ''}, ${shortUnit(info.mass, 'kg')}`,
    ...contactLines(scene, frame, body),
    ...stiffnessLines(scene, body, items),
  ];
  return lines.length > MOST_LINES ? [...lines.slice(0, MOST_LINES - 1), `and ${lines.length - MOST_LINES + 1} more`] : lines;
}

export class HoverLabel {
  private readonly label: HTMLElement;
  private body = -1;
  private text = '';
  private x = 0;
  private y = 0;

  constructor(private readonly parent: HTMLElement) {
    this.label = element('div', 'hover box', parent);
    this.label.hidden = true;
    this.label.setAttribute('role', 'tooltip');
  }

  /** Which body the pointer is over, -1: none; x, y in pixels of the page. */
  at(body: number, x: number, y: number): void {
    this.body = body;
    this.x = x;
    this.y = y;
  }

  /** Right of the pointer and below it, else left and above, and within the page in any case. */
  private place(): void {
    const beside = (at: number, size: number, end: number): string =>
      `${at + GAP + size <= end ? at + GAP : Math.max(0, at - GAP - size)}px`;
    this.label.style.left = beside(this.x, this.label.offsetWidth, this.parent.clientWidth);
    this.label.style.top = beside(this.y, this.label.offsetHeight, this.parent.clientHeight);
  }

  show(scene: SceneMessage | null, frame: Frame | null, items: readonly TunableInfo[]): void {
    const lines = scene && frame && this.body >= 0 ? hoverLines(scene, frame, this.body, items) : [];
    this.label.hidden = lines.length === 0;
    const text = lines.join('\n');
    if (text !== this.text) this.label.textContent = this.text = text;
    if (text) this.place();
  }
}
