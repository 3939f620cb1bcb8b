// Scenes and maps by their numbers, so that any frame, live or recorded, finds those it refers to.
import type { Frame, Maps, SceneMessage } from './messages';

export class Library {
  private readonly scenes = new Map<number, SceneMessage>();
  private readonly maps = new Map<string, Maps>();

  private static key(epoch: number, root: number, version: number): string {
    return `${epoch}/${root}/${version}`;
  }

  addScene(scene: SceneMessage): void {
    this.scenes.set(scene.epoch, scene);
  }

  addMaps(maps: Maps): void {
    this.maps.set(Library.key(maps.epoch, maps.root, maps.version), maps);
  }

  scene(epoch: number): SceneMessage | undefined {
    return this.scenes.get(epoch);
  }

  /** The maps of every root of the frame; undefined where one has not come yet. Free bodies have none. */
  mapsOf(frame: Frame): (Maps | null)[] | undefined {
    const scene = this.scenes.get(frame.epoch);
    if (!scene || scene.roots.length !== frame.roots.length) return undefined;
    const found: (Maps | null)[] = [];
    for (const [i, root] of frame.roots.entries()) {
      if (scene.roots[i]?.base === 'free') {
        found.push(null);
        continue;
      }
      const maps = this.maps.get(Library.key(frame.epoch, i, root.version));
      if (!maps) return undefined;
      found.push(maps);
    }
    return found;
  }

  /** Forgets maps that no frame can refer to any more. Not while something recorded may be shown again. */
  keepOnly(frame: Frame): void {
    const wanted = new Set(frame.roots.map((root, i) => Library.key(frame.epoch, i, root.version)));
    for (const key of this.maps.keys()) if (!wanted.has(key)) this.maps.delete(key);
    for (const epoch of this.scenes.keys()) if (epoch !== frame.epoch) this.scenes.delete(epoch);
  }

  clear(): void {
    this.scenes.clear();
    this.maps.clear();
  }
}
