import { describe, expect, it } from 'vitest';
import { Library } from '../../src/wire/library';
import type { Frame, GeometryMessage, Maps, SceneMessage } from '../../src/wire/messages';

const scene = (epoch: number, geometry: number): SceneMessage =>
  ({ epoch, geometry, roots: [{ base: 'fixed' }, { base: 'free' }] }) as unknown as SceneMessage;
const maps = (epoch: number, version: number): Maps => ({ epoch, root: 0, version }) as unknown as Maps;
const frame = (epoch: number, version: number): Frame =>
  ({ epoch, roots: [{ version }, { version: 0 }] }) as unknown as Frame;
const geometry = (version: number): GeometryMessage => ({ type: 'geometry', version, shapes: [], meshes: 0 });

describe('Library', () => {
  it('has shapes once their meshes have come', () => {
    const library = new Library();
    library.addGeometry(geometry(1));
    expect(library.shapesOf(scene(1, 1))).toBeUndefined();
    library.addMeshes([]);
    expect(library.shapesOf(scene(1, 1))?.geometry.version).toBe(1);
  });

  it('keeps shapes that came ahead of their scene and forgets those of scenes gone by', () => {
    const library = new Library();
    for (const version of [1, 2]) {
      library.addGeometry(geometry(version));
      library.addMeshes([]);
    }
    library.addScene(scene(1, 1));
    library.addMaps(maps(1, 1));
    expect(library.mapsOf(frame(1, 1))).toBeDefined();
    library.keepOnly(frame(1, 1));
    expect(library.shapesOf(scene(1, 1))).toBeDefined();
    library.addScene(scene(2, 2));
    library.addMaps(maps(2, 1));
    expect(library.mapsOf(frame(2, 1))).toBeDefined();
    library.keepOnly(frame(2, 1));
    expect(library.shapesOf(scene(1, 1))).toBeUndefined();
    expect(library.shapesOf(scene(2, 2))).toBeDefined();
    expect(library.mapsOf(frame(1, 1))).toBeUndefined();
  });

  it('finds the same maps for frames that refer to the same, and others after a refresh', () => {
    const library = new Library();
    library.addScene(scene(1, 1));
    library.addMaps(maps(1, 1));
    const first = library.mapsOf(frame(1, 1));
    expect(first?.[1]).toBeNull(); // a free body has none
    expect(library.mapsOf(frame(1, 1))).toBe(first);
    expect(library.mapsOf(frame(1, 2))).toBeUndefined(); // on its way
    library.addMaps(maps(1, 2));
    expect(library.mapsOf(frame(1, 2))?.[0]?.version).toBe(2);
    expect(library.mapsOf(frame(1, 1))?.[0]?.version).toBe(1);
  });
});
