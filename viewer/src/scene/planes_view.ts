// Planes that show a picture of the file: a checkered ground, say. One without end goes as far as the page's own ground
// and fades out as that does.
import * as THREE from 'three';
import type { ShapeInfo } from '../wire/messages';
import { apply, fromNumbers, inverse, type Rigid } from '../poses/rigid';
import { SAMPLE_PICTURE } from './pictures';

/** By how much bright tones are held back on a dark page: white does not glare, and what is dark stays legible. */
const DARK_RESTRAINT = 1.5;

/** Facing up. */
export function isLevel(plane: ShapeInfo): boolean {
  const [, , , , qx, qy] = plane.pose;
  return qx * qx + qy * qy < 1e-6;
}

/** Along x and y. */
export function isBounded(plane: ShapeInfo): boolean {
  const [a = 0, b = 0] = plane.size ?? [];
  return a > 0 && b > 0;
}

interface Plane {
  shape: ShapeInfo;
  X_PW: Rigid; // from the world to the plane
  mesh: THREE.Mesh;
  centre: THREE.Vector2; // of what is drawn, in the plane
  half: THREE.Vector2;
  fade: THREE.Vector4; // middle, reach along x and y; 0: does not fade that way
}

export class PlanesView {
  readonly group = new THREE.Group();
  private readonly restraint = { value: 0 };
  private planes: Plane[] = [];
  private at = new THREE.Vector3();
  private reach = 1;

  setDark(dark: boolean): void {
    this.restraint.value = dark ? DARK_RESTRAINT : 0;
  }

  show(shapes: readonly ShapeInfo[], pictures: THREE.IUniform<THREE.DataArrayTexture | null>): void {
    for (const { mesh } of this.planes) {
      mesh.geometry.dispose();
      (mesh.material as THREE.Material).dispose();
    }
    this.group.clear();
    this.planes = shapes.flatMap((shape) => (shape.picture === undefined || !shape.repeat ? [] : [this.make(shape, pictures)]));
    for (const { mesh } of this.planes) this.group.add(mesh);
    this.place(this.at, this.reach);
  }

  /** Planes without end are drawn around `at` as far as `reach`. */
  place(at: THREE.Vector3, reach: number): void {
    this.at = at.clone();
    this.reach = reach;
    for (const { shape, X_PW, centre, half, fade } of this.planes) {
      const [x, y] = apply(X_PW, [at.x, at.y, at.z]);
      const [a = 0, b = 0] = shape.size ?? [];
      centre.set(a > 0 ? 0 : x, b > 0 ? 0 : y);
      half.set(a > 0 ? a : reach, b > 0 ? b : reach);
      fade.set(x, y, a > 0 ? 0 : 1 / reach, b > 0 ? 0 : 1 / reach);
    }
  }

  /** Whether one without end lies level at this height [m]. */
  covers(height: number): boolean {
    return (
      this.group.visible &&
      this.planes.some(({ shape }) => !isBounded(shape) && isLevel(shape) && Math.abs(shape.pose[2] - height) < 1e-6 * (1 + Math.abs(height)))
    );
  }

  private make(shape: ShapeInfo, pictures: THREE.IUniform<THREE.DataArrayTexture | null>): Plane {
    const [x, y, z, qw, qx, qy, qz] = shape.pose;
    const centre = new THREE.Vector2();
    const half = new THREE.Vector2(1, 1);
    const fade = new THREE.Vector4();
    const [r, g, b, opacity] = shape.rgba;
    const ends = isBounded(shape);
    // One that ends is a thing like others, and lies on what is level with it. One without end writes no depth and
    // lies back a little: the shadows on the page's ground are drawn on it.
    const material = new THREE.MeshLambertMaterial({
      color: new THREE.Color().setRGB(r, g, b, THREE.SRGBColorSpace),
      opacity,
      transparent: !ends || opacity < 1,
      depthWrite: ends,
      polygonOffset: true,
      polygonOffsetFactor: ends ? -1 : 1,
      polygonOffsetUnits: ends ? -1 : 1,
    });
    const [rx = 0, ry = 0] = shape.repeat ?? [];
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, {
        pictures,
        restraint: this.restraint,
        centre: { value: centre },
        halfSize: { value: half },
        fade: { value: fade },
        layer: { value: shape.picture },
        repeat: { value: new THREE.Vector2(rx, ry) },
      });
      shader.vertexShader = shader.vertexShader
        .replace('#include <common>', '#include <common>\nuniform vec2 centre, halfSize;\nout vec2 place;')
        .replace('#include <begin_vertex>', 'vec3 transformed = vec3(centre + position.xy * halfSize, 0.0);\nplace = transformed.xy;');
      shader.fragmentShader = shader.fragmentShader
        .replace(
          '#include <common>',
          `#include <common>
           uniform highp sampler2DArray pictures;
           uniform float restraint, layer;
           uniform vec2 repeat;
           uniform vec4 fade;
           in vec2 place;
           ${SAMPLE_PICTURE}`,
        )
        .replace(
          '#include <color_fragment>',
          `#include <color_fragment>
           // One picture lies in the middle of the plane, its rows from the top.
           diffuseColor.rgb *= samplePicture(pictures, vec3(repeat * vec2(place.x, -place.y) - 0.5, layer));
           diffuseColor.rgb /= 1.0 + restraint * dot(diffuseColor.rgb, vec3(0.2126, 0.7152, 0.0722));
           diffuseColor.a *= 1.0 - smoothstep(0.25, 1.0, length((place - fade.xy) * fade.zw));`,
        );
    };
    const mesh = new THREE.Mesh(new THREE.PlaneGeometry(2, 2), material);
    mesh.position.set(x, y, z);
    mesh.quaternion.set(qx, qy, qz, qw);
    mesh.frustumCulled = false;
    mesh.renderOrder = ends ? 0 : -1;
    mesh.receiveShadow = ends;
    return { shape, X_PW: inverse(fromNumbers(shape.pose)), mesh, centre, half, fade };
  }
}
