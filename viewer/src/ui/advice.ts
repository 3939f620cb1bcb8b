// Bodies that pass through others because they are no interface, with the button that makes them one.
import type { Request } from '../net/live';
import type { AdviceMessage, SceneMessage } from '../wire/messages';
import { element, shortUnit, textButton } from './dom';

export class Advice {
  private readonly root: HTMLElement;
  private readonly closed = new Set<string>();

  constructor(
    parent: HTMLElement,
    private readonly send: (request: Request) => void,
  ) {
    this.root = element('div', 'advice', parent);
    this.root.setAttribute('role', 'status');
  }

  use(message: AdviceMessage, scene: SceneMessage | null): void {
    this.root.replaceChildren();
    if (!scene) return;
    for (const { body, name, other, depth, time } of message.items) {
      const about = `${name}/${other}`;
      if (this.closed.has(about)) continue;
      const box = element('div', 'problem box', this.root);
      const text = element('div', '', box);
      element('p', '', text).textContent = `'${name}' passed ${shortUnit(1000 * depth, 'mm')} into '${other}' at ${time.toFixed(1)} s: it is no interface body, so nothing stops it.`;
      textButton(`Make '${name}' an interface`, element('div', 'bar', text), () => {
        const root = scene.bodies[body]?.root ?? -1;
        const bodies = scene.bodies.flatMap((b, i) => (b.root === root && b.parent >= 0 && (b.interface || i === body) ? [i] : []));
        this.send({ type: 'interfaces', mechanism: root, bodies });
        box.remove();
      });
      const close = element('button', '', box);
      close.type = 'button';
      close.textContent = '×';
      close.setAttribute('aria-label', 'Close');
      close.addEventListener('click', () => {
        this.closed.add(about);
        box.remove();
      });
    }
  }

  clear(): void {
    this.root.replaceChildren();
  }
}
