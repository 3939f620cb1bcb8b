// Materials that place every vertex by the pose texture: two texel fetches a vertex.
import * as THREE from 'three';
import { RIGID_GLSL } from '../poses/glsl';

export interface PosedUniforms {
  poseQ: THREE.IUniform<THREE.Texture | null>;
  poseP: THREE.IUniform<THREE.Texture | null>;
  styles: THREE.IUniform<THREE.Texture | null>;
  spread: THREE.IUniform<THREE.Vector3>;
}

const DECLARATIONS = /* glsl */ `
in float body;
uniform highp sampler2D poseQ;
uniform highp sampler2D poseP;
uniform sampler2D styles;
uniform vec3 spread;  // columns, distance, half the width of a field of copies
${RIGID_GLSL}
vec4 bodyQ() { return texelFetch(poseQ, ivec2(int(body + 0.5), gl_InstanceID), 0); }
vec3 bodyP() {
  float column = mod(float(gl_InstanceID), spread.x), row = floor(float(gl_InstanceID) / spread.x);
  return texelFetch(poseP, ivec2(int(body + 0.5), gl_InstanceID), 0).xyz +
    vec3(column * spread.y - spread.z, row * spread.y - spread.z, 0.0) * step(1.5, spread.x);
}
`;

function patch(material: THREE.Material, uniforms: PosedUniforms, withColour: boolean): void {
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    let vertex = shader.vertexShader
      .replace('#include <common>', `#include <common>\n${DECLARATIONS}`)
      .replace('#include <begin_vertex>', 'vec3 transformed = turn(bodyQ(), position) + bodyP();')
      .replace('#include <beginnormal_vertex>', 'vec3 objectNormal = turn(bodyQ(), normal);');
    if (withColour)
      vertex = vertex.replace(
        '#include <color_vertex>',
        `#include <color_vertex>
         vec4 style = texelFetch(styles, ivec2(int(body + 0.5), 0), 0);
         vColor.rgb = mix(vColor.rgb, style.rgb, style.a);`,
      );
    shader.vertexShader = vertex;
  };
}

export function posedSurface(uniforms: PosedUniforms, options: THREE.MeshStandardMaterialParameters): THREE.Material {
  const material = new THREE.MeshStandardMaterial({ vertexColors: true, ...options });
  patch(material, uniforms, true);
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
        identity = body + 1.0;
        gl_Position = projectionMatrix * viewMatrix * vec4(turn(bodyQ(), position) + bodyP(), 1.0);
      }`,
    fragmentShader: /* glsl */ `
      in vec3 local;
      flat in float identity;
      layout(location = 0) out vec4 result;
      void main() { result = vec4(local, identity); }`,
  });
}
