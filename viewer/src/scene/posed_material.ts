// Materials that place every vertex by the lists of poses: two texel fetches a vertex.
import * as THREE from 'three';
import { LIST_GLSL, RIGID_GLSL } from '../poses/glsl';
import type { PoseLists } from '../poses/gpu';
import { PICTURE_FRAGMENT, PICTURE_VERTEX, USE_PICTURE } from './pictures';

export interface PosedUniforms {
  poseQ: THREE.IUniform<THREE.Texture | null>;
  poseP: THREE.IUniform<THREE.Texture | null>;
  styles: THREE.IUniform<THREE.Texture | null>;
  spread: THREE.IUniform<THREE.Vector3>;
  copies: THREE.IUniform<number>;
  bodies: THREE.IUniform<number>; // of one copy
  pictures: THREE.IUniform<THREE.DataArrayTexture | null>;
}

export function posedUniforms(styles: PosedUniforms['styles'] = { value: null }): PosedUniforms {
  return {
    poseQ: { value: null },
    poseP: { value: null },
    styles,
    spread: { value: new THREE.Vector3(1, 0, 0) },
    copies: { value: 1 },
    bodies: { value: 1 },
    pictures: { value: null },
  };
}

export function usePoses(uniforms: PosedUniforms, poses: PoseLists): void {
  uniforms.poseQ.value = poses.quaternions;
  uniforms.poseP.value = poses.positions;
  uniforms.copies.value = poses.copies;
  uniforms.bodies.value = poses.bodies;
}

// An instance is one member of a batch (shapes.ts) in one copy of the whole, the copies of a member one after the
// other; `first` is the member's first body.
const DECLARATIONS = /* glsl */ `
in float body;
in float first;
uniform highp sampler2D poseQ;
uniform highp sampler2D poseP;
uniform highp sampler2D styles;
uniform int copies;
uniform int bodies;
uniform vec3 spread;  // columns, distance, half the width of a field of copies
${LIST_GLSL}
${RIGID_GLSL}
int bodyIndex() { return int(first + body + 0.5); }
// The second half of the styles: how much of a body is shown.
float bodyShown() { return entry(styles, bodies + bodyIndex()).x; }
const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);
int copyIndex() { return gl_InstanceID % copies; }
vec4 bodyQ() { return entry(poseQ, copyIndex() * bodies + bodyIndex()); }
vec3 bodyP() {
  float copy = float(copyIndex());
  float column = mod(copy, spread.x), row = floor(copy / spread.x);
  return entry(poseP, copyIndex() * bodies + bodyIndex()).xyz +
    vec3(column * spread.y - spread.z, row * spread.y - spread.z, 0.0) * step(1.5, spread.x);
}
`;

// A body that is shown in part leaves out pixels by a fixed pattern of 4 x 4: no order of drawing matters.
const FADE = /* glsl */ `
flat in float share;
const float PATTERN[16] = float[16](0.0, 8.0, 2.0, 10.0, 12.0, 4.0, 14.0, 6.0, 3.0, 11.0, 1.0, 9.0, 15.0, 7.0, 13.0, 5.0);
bool isLeftOut() {
  ivec2 at = ivec2(gl_FragCoord.xy) & 3;
  return share < 1.0 && share * 16.0 <= PATTERN[at.x + 4 * at.y];
}
`;

function patch(material: THREE.Material, uniforms: PosedUniforms, withColour: boolean): void {
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    let vertex = shader.vertexShader
      .replace('#include <common>', `#include <common>\n${DECLARATIONS}\n${withColour ? PICTURE_VERTEX : ''}\nflat out float share;`)
      .replace(
        '#include <project_vertex>',
        `#include <project_vertex>
         share = bodyShown();
         if (share <= 0.0) gl_Position = NOWHERE;`,
      )
      .replace('#include <begin_vertex>', 'vec3 transformed = turn(bodyQ(), position) + bodyP();')
      .replace('#include <beginnormal_vertex>', 'vec3 objectNormal = turn(bodyQ(), normal);');
    if (withColour)
      vertex = vertex.replace(
        '#include <color_vertex>',
        `#include <color_vertex>
         vec4 style = entry(styles, bodyIndex());
         vColor.rgb = mix(vColor.rgb, style.rgb, style.a);
         #ifdef PICTURES
         placeInPicture = pictureAt;
         pictureShare = 1.0 - style.a;
         #endif`,
      );
    shader.vertexShader = vertex;
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', `#include <common>\n${FADE}\n${withColour ? PICTURE_FRAGMENT : ''}`)
      .replace('#include <color_fragment>', withColour ? USE_PICTURE : '#include <color_fragment>')
      .replace('#include <alphatest_fragment>', '#include <alphatest_fragment>\n  if (isLeftOut()) discard;');
  };
}

export function posedSurface(uniforms: PosedUniforms, options: THREE.MeshStandardMaterialParameters): THREE.MeshStandardMaterial {
  const material = new THREE.MeshStandardMaterial({ vertexColors: true, ...options });
  patch(material, uniforms, material.vertexColors);
  return material;
}

/** Of what stands still: no poses, but pictures. */
export function stillSurface(uniforms: PosedUniforms, options: THREE.MeshStandardMaterialParameters): THREE.MeshStandardMaterial {
  const material = new THREE.MeshStandardMaterial({ vertexColors: true, ...options });
  material.onBeforeCompile = (shader) => {
    shader.uniforms['pictures'] = uniforms.pictures;
    shader.vertexShader = shader.vertexShader.replace('#include <common>', `#include <common>\n${PICTURE_VERTEX}`).replace(
      '#include <color_vertex>',
      `#include <color_vertex>
       #ifdef PICTURES
       placeInPicture = pictureAt;
       pictureShare = 1.0;
       #endif`,
    );
    shader.fragmentShader = shader.fragmentShader
      .replace('#include <common>', `#include <common>\n${PICTURE_FRAGMENT}`)
      .replace('#include <color_fragment>', USE_PICTURE);
  };
  return material;
}

export function posedDepth(uniforms: PosedUniforms): THREE.Material {
  const material = new THREE.MeshDepthMaterial({ depthPacking: THREE.RGBADepthPacking });
  patch(material, uniforms, false);
  return material;
}

/** Writes the point in the body's own frame and body + 1: what a pointer hits, to the last digit of a float. */
export function posedIdentity(uniforms: PosedUniforms): THREE.ShaderMaterial {
  return new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    uniforms: uniforms as unknown as Record<string, THREE.IUniform>,
    vertexShader: /* glsl */ `${DECLARATIONS}
      out vec3 local;
      flat out float identity;
      void main() {
        local = position;
        identity = float(bodyIndex() + 1);
        gl_Position = projectionMatrix * viewMatrix * vec4(turn(bodyQ(), position) + bodyP(), 1.0);
        if (bodyShown() < 0.3) gl_Position = NOWHERE; // what is hardly seen is not in the pointer's way
      }`,
    fragmentShader: /* glsl */ `
      in vec3 local;
      flat in float identity;
      layout(location = 0) out vec4 result;
      void main() { result = vec4(local, identity); }`,
  });
}
