// Lists of four numbers an entry, in float textures. Read by entry() of glsl.ts.
import * as THREE from 'three';

/** Every browser with WebGL 2 has textures this wide and high: lists of four million entries. */
const WIDEST = 2048;

export function listSize(entries: number): [number, number] {
  const width = Math.max(1, Math.min(entries, WIDEST));
  return [width, Math.max(1, Math.ceil(entries / width))];
}

export function listTexture(entries: number): THREE.DataTexture {
  const [width, height] = listSize(entries);
  const texture = new THREE.DataTexture(new Float32Array(4 * width * height), width, height, THREE.RGBAFormat, THREE.FloatType);
  texture.needsUpdate = true;
  return texture;
}

/** Four numbers an entry. Set `needsUpdate` after a change. */
export function numbers(list: THREE.DataTexture): Float32Array {
  return list.image.data as Float32Array;
}
