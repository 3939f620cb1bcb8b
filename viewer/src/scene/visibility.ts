// Which bodies are shown, and how much of them: by name, so that a choice outlives a model that is built again.
import type { SceneMessage } from '../wire/messages';

export class Visibility {
  private readonly hidden = new Set<string>();
  private readonly faded = new Map<string, number>(); // share that is drawn

  /** 1: all of it, 0: nothing. */
  of(name: string): number {
    return this.hidden.has(name) ? 0 : (this.faded.get(name) ?? 1);
  }

  isHidden(name: string): boolean {
    return this.hidden.has(name);
  }

  setHidden(names: readonly string[], hidden: boolean): void {
    for (const name of names)
      if (hidden) this.hidden.add(name);
      else this.hidden.delete(name);
  }

  setShare(name: string, share: number): void {
    if (share < 1) this.faded.set(name, share);
    else this.faded.delete(name);
  }

  /** These alone are shown. */
  isolate(scene: SceneMessage, names: ReadonlySet<string>): void {
    this.hidden.clear();
    for (const { name } of scene.bodies) if (!names.has(name)) this.hidden.add(name);
  }

  showAll(): void {
    this.hidden.clear();
    this.faded.clear();
  }

  get isPlain(): boolean {
    return this.hidden.size === 0 && this.faded.size === 0;
  }
}

/** A body and all that it carries, as places in the scene's list. */
export function subtree(scene: SceneMessage, body: number): number[] {
  const inside = new Set([body]);
  // Parents come before children.
  scene.bodies.forEach((b, i) => {
    if (inside.has(b.parent)) inside.add(i);
  });
  return [...inside];
}
