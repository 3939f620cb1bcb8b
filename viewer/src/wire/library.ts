// Shapes, scenes and maps by their numbers, so that any frame, live or recorded, finds those it refers to.
import type { Frame, GeometryMessage, Maps, MeshData, SceneMessage, Shapes } from './messages';

export class Library {
  private readonly scenes = new Map<number, SceneMessage>();
  private readonly maps = new Map<string, Maps>();
  private readonly shapes = new Map<number, Shapes>();
  private found: { epoch: number; versions: Uint32Array; maps: (Maps | null)[] } | null = null; // for the last frame
  private kept: object | null = null; // nothing was forgotten since
  private awaited: GeometryMessage | null = null; // its meshes are still to come

  private static key(epoch: number, root: number, version: number): string {
    return `${epoch}/${root}/${version}`;
  }

  addGeometry(message: GeometryMessage): void {
    this.awaited = message;
  }

  /** Of the geometry that came before them. */
  addMeshes(meshes: MeshData[], pictures: Uint8Array[] = []): void {
    if (this.awaited) this.shapes.set(this.awaited.version, { geometry: this.awaited, meshes, pictures });
    this.awaited = null;
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

  /** The shapes of a scene; undefined while they have not come yet. */
  shapesOf(scene: SceneMessage): Shapes | undefined {
    return this.shapes.get(scene.geometry);
  }

  /** The maps of every root of the frame; undefined where one has not come yet. Free bodies have none. */
  mapsOf(frame: Frame): (Maps | null)[] | undefined {
    const scene = this.scenes.get(frame.epoch);
    if (!scene || scene.roots.length !== frame.roots.length) return undefined;
    // Most frames refer to the maps of the one before: with a thousand roots it pays to look.
    const last = this.found;
    if (last && last.epoch === frame.epoch && frame.roots.every((root, i) => root.version === last.versions[i])) return last.maps;
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
    this.found = { epoch: frame.epoch, versions: Uint32Array.from(frame.roots, (root) => root.version), maps: found };
    return found;
  }

  /** Forgets what no frame can refer to any more. Not while something recorded may be shown again. */
  keepOnly(frame: Frame): void {
    if (this.found && this.found === this.kept) return;
    this.kept = this.found;
    const wanted = new Set(frame.roots.map((root, i) => Library.key(frame.epoch, i, root.version)));
    for (const key of this.maps.keys()) if (!wanted.has(key)) this.maps.delete(key);
    const { geometry } = this.scenes.get(frame.epoch) ?? { geometry: 0 };
    for (const epoch of this.scenes.keys()) if (epoch !== frame.epoch) this.scenes.delete(epoch);
    // Newer shapes may be here already, ahead of their scene.
    for (const version of this.shapes.keys()) if (version < geometry) this.shapes.delete(version);
  }

  clear(): void {
    this.scenes.clear();
    this.maps.clear();
    this.shapes.clear();
    this.found = this.kept = null;
  }
}
