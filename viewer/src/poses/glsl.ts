// Poses on the GPU, in passes of fragments. Rigid motions are those of shaders/rigid.glsl, which other engines use too; the
// equations are those of rigid.ts.
import rigid from '../../../shaders/rigid.glsl?raw';

/** Textures as lists of four numbers: what is longer than a texture may be wide goes on in the next row (lists.ts). */
export const LIST_GLSL = /* glsl */ `
vec4 entry(highp sampler2D list, int i) {
  int width = textureSize(list, 0).x;
  return texelFetch(list, ivec2(i % width, i / width), 0);
}
`;

export const RIGID_GLSL = rigid;

// Lists in order of their indices, the first one slowest. Fragments after the end of a list draw nothing.
const PASS_GLSL = /* glsl */ `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform int roots;    // of one copy
uniform int blocks;   // ceil(r/4)
uniform int each;     // results of one copy
uniform int count;    // of all copies
uniform int width;    // of the target
${LIST_GLSL}
int fragment() { return int(gl_FragCoord.y) * width + int(gl_FragCoord.x); }
`;

/** One fragment a joint coordinate and copy: q = rest + Q z. */
export const COORDINATE_SHADER = /* glsl */ `
${PASS_GLSL}
uniform sampler2D rests;      // copy, coordinate: q_ref + correction
uniform sampler2D maps;       // coordinate, block: Q
uniform sampler2D reduced;    // copy, root, block: z
uniform sampler2D rootOf;     // coordinate
layout(location = 0) out vec4 result;
void main() {
  int i = fragment();
  if (i >= count) discard;
  int copy = i / each, coordinate = i % each;
  int first = (copy * roots + int(entry(rootOf, coordinate).x)) * blocks;
  float q = entry(rests, i).x;
  for (int k = 0; k < blocks; ++k) q += dot(entry(maps, coordinate * blocks + k), entry(reduced, first + k));
  result = vec4(q, 0.0, 0.0, 1.0);
}
`;

/** One fragment a body and copy: exact walks the body's path, twist takes one exponential. */
export const POSE_SHADER = /* glsl */ `
${PASS_GLSL}
uniform sampler2D bodies;       // body, 3: (root, last joint), quaternion, position at q = 0
uniform sampler2D joints;       // joint: (previous, offset, size)
uniform sampler2D screws;       // coordinate, 2: angular, linear
uniform sampler2D coordinates;  // copy, coordinate
uniform sampler2D reduced;      // copy, root, block: z
uniform sampler2D twists;       // body, column, 2: T_B, angular and linear part
uniform sampler2D references;   // body, 2: quaternion, position at q_ref
uniform sampler2D bases;        // copy, root, 2: quaternion, position
uniform int coordinatesEach;    // of one copy
uniform bool twistMode;
layout(location = 0) out vec4 quaternion;
layout(location = 1) out vec4 position;
${RIGID_GLSL}
void main() {
  int i = fragment();
  if (i >= count) discard;
  int copy = i / each, body = i % each;
  vec4 info = entry(bodies, 3 * body);
  int root = copy * roots + int(info.x);
  vec4 q = entry(bodies, 3 * body + 1);
  vec3 p = entry(bodies, 3 * body + 2).xyz;
  vec4 dq;
  vec3 dp;
  if (twistMode && info.z > 0.5) {
    vec3 w = vec3(0.0), v = vec3(0.0);
    for (int k = 0; k < blocks; ++k) {
      vec4 z = entry(reduced, root * blocks + k);
      for (int c = 0; c < 4; ++c) {
        int column = 2 * (4 * (body * blocks + k) + c);
        w += z[c] * entry(twists, column).xyz;
        v += z[c] * entry(twists, column + 1).xyz;
      }
    }
    exponential(w, v, dq, dp);
    q = times(dq, entry(references, 2 * body));
    p = turn(dq, entry(references, 2 * body + 1).xyz) + dp;
  } else {
    int joint = int(info.y);
    while (joint >= 0) {
      vec4 j = entry(joints, joint);
      vec3 w = vec3(0.0), v = vec3(0.0);
      int first = int(j.y), size = int(j.z);
      for (int c = first; c < first + size; ++c) {
        float x = entry(coordinates, copy * coordinatesEach + c).x;
        w += x * entry(screws, 2 * c).xyz;
        v += x * entry(screws, 2 * c + 1).xyz;
      }
      exponential(w, v, dq, dp);
      q = times(dq, q);
      p = turn(dq, p) + dp;
      joint = int(j.x);
    }
  }
  dq = entry(bases, 2 * root);
  dp = entry(bases, 2 * root + 1).xyz;
  quaternion = normalize(times(dq, q));
  position = vec4(turn(dq, p) + dp, 1.0);
}
`;

export const FULLSCREEN_VERTEX = /* glsl */ `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }
`;
