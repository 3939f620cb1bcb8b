// Choosing the interface bodies by clicking them; the model is reduced again when the choice is taken.
import type { Request } from '../net/live';
import type { View } from '../view';
import type { SceneMessage } from '../wire/messages';
import { element } from './dom';

export interface PickingActions {
  send(request: Request): void;
  changed(on: boolean): void;
}

export class Picking {
  on = false;
  private readonly card: HTMLElement;
  private readonly text: HTMLElement;
  private readonly apply: HTMLButtonElement;
  private chosen = new Set<number>();
  private scene: SceneMessage | null = null;

  constructor(
    parent: HTMLElement,
    private readonly view: View,
    private readonly actions: PickingActions,
  ) {
    this.card = element('div', 'pick box', parent);
    this.card.hidden = true;
    this.text = element('p', '', this.card);
    const bar = element('div', 'bar', this.card);
    this.apply = element('button', 'text', bar);
    this.apply.type = 'button';
    this.apply.textContent = 'Reduce to these';
    this.apply.title = 'The model is reduced again with these interface bodies';
    this.apply.addEventListener('click', () => this.take());
    const cancel = element('button', 'text', bar);
    cancel.type = 'button';
    cancel.textContent = 'Cancel';
    cancel.title = 'Cancel (Esc)';
    cancel.addEventListener('click', () => this.end());
  }

  useScene(scene: SceneMessage): void {
    this.scene = scene;
    if (this.on) this.begin();
  }

  toggle(): void {
    if (this.on) this.end();
    else this.begin();
  }

  private begin(): void {
    this.on = true;
    this.chosen = new Set(this.scene?.bodies.flatMap((body, b) => (body.interface ? [b] : [])));
    this.card.hidden = false;
    this.update(); // the card's size depends on its text
    this.actions.changed(true);
  }

  private end(): void {
    this.on = false;
    this.card.hidden = true;
    this.view.marked.clear();
    this.view.style();
    this.actions.changed(false);
  }

  choose(body: number): void {
    const info = this.scene?.bodies[body];
    if (!info || info.parent < 0) return; // bases and free bodies touch the world anyway
    if (!this.chosen.delete(body)) this.chosen.add(body);
    this.update();
  }

  private update(): void {
    const names = [...this.chosen].map((b) => this.scene?.bodies[b]?.name ?? '');
    this.text.textContent =
      names.length > 0
        ? `Click bodies to choose what touches the world: ${names.join(', ')}`
        : 'Click the bodies that touch the world.';
    this.apply.disabled = names.length === 0;
    this.view.marked.clear();
    for (const b of this.chosen) this.view.marked.add(b);
    this.view.style();
  }

  private take(): void {
    const scene = this.scene;
    if (!scene) return;
    scene.roots.forEach((root, mechanism) => {
      if (root.base === 'free') return;
      const bodies = [...this.chosen].filter((b) => scene.bodies[b]?.root === mechanism);
      const before = scene.bodies.flatMap((body, b) => (body.interface && body.root === mechanism ? [b] : []));
      const same = bodies.length === before.length && bodies.every((b) => before.includes(b));
      if (!same) this.actions.send({ type: 'interfaces', mechanism, bodies });
    });
    this.end();
  }
}
