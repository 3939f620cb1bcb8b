// Pictures on shapes, as layers of one texture: all shapes stay in one draw.
import * as THREE from 'three';

const LARGEST_SIDE = 2048; // texels of a layer
const MOST_BYTES = 256 * 1024 * 1024;

/** Width and height as a PNG file says them at its beginning. */
export function sizeOfPng(png: Uint8Array): { width: number; height: number } {
  const words = new DataView(png.buffer, png.byteOffset, png.byteLength);
  return png.byteLength < 24 ? { width: 1, height: 1 } : { width: words.getUint32(16), height: words.getUint32(20) };
}

/** Texels along the side of every layer: enough for the largest picture, if memory allows. */
export function sideOf(pictures: readonly Uint8Array[]): number {
  let side = 1;
  const largest = Math.max(1, ...pictures.map(sizeOfPng).map(({ width, height }) => Math.max(width, height)));
  while (side < Math.min(largest, LARGEST_SIDE)) side *= 2;
  while (side > 1 && side * side * 4 * pictures.length > MOST_BYTES) side /= 2;
  return side;
}

export class Pictures {
  /** null where no shape has one */
  readonly texture: THREE.DataArrayTexture | null = null;
  /** when all of them are there; until then they are white */
  readonly ready: Promise<void> = Promise.resolve();

  constructor(pictures: readonly Uint8Array[]) {
    if (pictures.length === 0) return;
    const side = sideOf(pictures);
    const texels = new Uint8Array(side * side * 4 * pictures.length).fill(255);
    this.texture = new THREE.DataArrayTexture(texels, side, side, pictures.length);
    this.texture.wrapS = this.texture.wrapT = THREE.RepeatWrapping;
    this.texture.minFilter = THREE.LinearMipmapLinearFilter;
    this.texture.magFilter = THREE.LinearFilter;
    this.texture.generateMipmaps = true;
    this.texture.anisotropy = 8;
    this.texture.needsUpdate = true;
    this.ready = Promise.all(pictures.map((png, layer) => this.fill(png, layer, side, texels))).then(() => {
      if (this.texture) this.texture.needsUpdate = true;
    });
  }

  private async fill(png: Uint8Array, layer: number, side: number, texels: Uint8Array): Promise<void> {
    const image = await createImageBitmap(new Blob([png.slice()], { type: 'image/png' }));
    const canvas = document.createElement('canvas');
    canvas.width = canvas.height = side;
    const context = canvas.getContext('2d', { willReadFrequently: true });
    if (!context) return;
    context.drawImage(image, 0, 0, side, side);
    texels.set(context.getImageData(0, 0, side, side).data, side * side * 4 * layer);
    image.close();
  }

  dispose(): void {
    this.texture?.dispose();
  }
}

/** Shader text: what a picture does to a surface. `share` is an expression in the vertex shader: 1 where the file's own
 * colours show, 0 where others lie over them. */
export const PICTURE_VERTEX = /* glsl */ `
#ifdef PICTURES
in vec3 pictureAt;  // place in the picture, and its layer; -1: none
out vec3 placeInPicture;
flat out float pictureShare;
#endif
`;

/** Of a layer, in linear tones. */
export const SAMPLE_PICTURE = /* glsl */ `
vec3 samplePicture(highp sampler2DArray from, vec3 at) {
  vec3 c = texture(from, at).rgb;  // sRGB
  return mix(pow(c * 0.9478672986 + 0.0521327014, vec3(2.4)), c * 0.0773993808, vec3(lessThanEqual(c, vec3(0.04045))));
}
`;

export const PICTURE_FRAGMENT = /* glsl */ `
#ifdef PICTURES
uniform highp sampler2DArray pictures;
in vec3 placeInPicture;
flat in float pictureShare;
${SAMPLE_PICTURE}
vec3 toneOfPicture() {
  if (placeInPicture.z < -0.5) return vec3(1.0);
  return mix(vec3(1.0), samplePicture(pictures, vec3(placeInPicture.xy, floor(placeInPicture.z + 0.5))), pictureShare);
}
#endif
`;

export const USE_PICTURE = /* glsl */ `#include <color_fragment>
#ifdef PICTURES
  diffuseColor.rgb *= toneOfPicture();
#endif
`;

/** Shows the pictures on a material whose shader has these texts, or none. */
export function definePictures(material: THREE.MeshStandardMaterial, on: boolean): void {
  // Every material has them; three's types know them only of shader materials.
  const { defines } = material as unknown as { defines: Record<string, string> };
  if ('PICTURES' in defines === on) return;
  if (on) defines['PICTURES'] = '';
  else delete defines['PICTURES'];
  material.needsUpdate = true;
}
