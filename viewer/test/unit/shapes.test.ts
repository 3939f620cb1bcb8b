import { describe, expect, it } from 'vitest';
import { groupShapes, mergeShapes, type ShapeChoice } from '../../src/scene/shapes';
import type { RootInfo, ShapeInfo } from '../../src/wire/messages';

const VISUAL: ShapeChoice = { shapes: 'visual', hiddenGroups: new Set() };
const shape = (body: number, size: number[], more: Partial<ShapeInfo> = {}): ShapeInfo => ({
  body,
  name: '',
  kind: 'box',
  pose: [0, 0, 0, 1, 0, 0, 0],
  rgba: [1, 0, 0, 1],
  group: 0,
  collides: true,
  size,
  ...more,
});
const root = (first_body: number, bodies: number): RootInfo => ({
  name: '',
  base: 'fixed',
  first_body,
  bodies,
  first_coordinate: 0,
  coordinates: 0,
  mass: 1,
});

describe('groupShapes', () => {
  it('finds roots that look the same, body by body', () => {
    const roots = Array.from({ length: 10 }, (_, i) => root(2 * i, 2));
    // The third is a little wider, the fifth has its shapes on the other body.
    const shapes = roots.flatMap((_, i) => [shape(2 * i + (i === 4 ? 1 : 0), [1, 1, i === 2 ? 1.1 : 1]), shape(2 * i + 1, [2, 2, 2])]);
    const groups = groupShapes(shapes, roots);
    expect(groups.length).toBe(2);
    expect(groups[0]?.firsts).toEqual([0, 2, 6, 10, 12, 14, 16, 18]);
    expect(groups[0]?.shapes.map((s) => s.body)).toEqual([0, 1]);
    // What is alone counts bodies from the first of all.
    expect(groups[1]?.firsts).toEqual([0]);
    expect(groups[1]?.shapes.map((s) => s.body).sort((a, b) => a - b)).toEqual([4, 5, 9, 9]);
  });

  it('leaves the still world out', () => {
    expect(groupShapes([shape(-1, [1, 1, 1])], [root(0, 1)])).toEqual([]);
  });
});

describe('mergeShapes', () => {
  it('tells every triangle of a group once, and bodies from their first', () => {
    const roots = Array.from({ length: 6 }, (_, i) => root(3 * i, 3));
    const shapes = roots.flatMap((_, i) => [shape(3 * i + 2, [1, 1, 1])]);
    const { moving, still } = mergeShapes({ geometry: { type: 'geometry', version: 1, shapes, meshes: 0 }, meshes: [], pictures: [] }, roots, VISUAL);
    expect(still).toBeNull();
    expect(moving.length).toBe(1);
    expect([...(moving[0]?.firsts ?? [])]).toEqual([0, 3, 6, 9, 12, 15]);
    expect(moving[0]?.geometry.index?.count).toBe(36);
    expect(new Set(moving[0]?.geometry.getAttribute('body').array)).toEqual(new Set([2]));
  });

  it('says of every corner where it lies in which picture', () => {
    const meshes = [
      {
        positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]),
        triangles: new Uint32Array([0, 1, 2]),
        uv: new Float32Array([0, 0, 1, 0, 0, 0.5]),
      },
      { positions: new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0]), triangles: new Uint32Array([0, 1, 2]), uv: new Float32Array() },
    ];
    // The second mesh does not say where, and a box has no picture of a file's.
    const shapes = [0, 1].map((mesh) => shape(0, [], { kind: 'mesh', mesh, picture: 1, rgba: [1, 1, 0, 1] }));
    shapes.push(shape(0, [1, 1, 1]));
    const pictures = [new Uint8Array(), new Uint8Array()];
    const { moving } = mergeShapes(
      { geometry: { type: 'geometry', version: 1, shapes, meshes: 2 }, meshes, pictures },
      [root(0, 1)],
      VISUAL,
    );
    const at = [...(moving[0]?.geometry.getAttribute('pictureAt').array ?? [])];
    expect(at.slice(0, 9)).toEqual([0, 0, 1, 1, 0, 1, 0, 0.5, 1]);
    expect(at.slice(9, 18)).toEqual([0, 0, -1, 0, 0, -1, 0, 0, -1]);
    expect(new Set(at.slice(9).filter((_, i) => i % 3 === 2))).toEqual(new Set([-1]));
    const none = mergeShapes({ geometry: { type: 'geometry', version: 1, shapes, meshes: 2 }, meshes, pictures: [] }, [root(0, 1)], VISUAL);
    expect(none.moving[0]?.geometry.hasAttribute('pictureAt')).toBe(false);
  });

  it('gives round shapes fewer facets where there are many', () => {
    const count = (n: number): number => {
      const roots = Array.from({ length: n }, (_, i) => root(i, 1));
      const shapes = roots.map((_, i) => shape(i, [1], { kind: 'sphere' }));
      const shown = mergeShapes({ geometry: { type: 'geometry', version: 1, shapes, meshes: 0 }, meshes: [], pictures: [] }, roots, VISUAL);
      return shown.moving[0]?.geometry.index?.count ?? 0;
    };
    expect(count(10)).toBe(count(400));
    expect(count(5000)).toBeLessThan(count(10) / 5);
  });
});
