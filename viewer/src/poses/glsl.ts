// Rigid motions on the GPU. sin and cos of GPUs may be wrong by 1e-4, so the exponential uses polynomials: about
// 1e-7 in single precision. The equations are those of rigid.ts.

/** Textures as lists of four numbers: what is longer than a texture may be wide goes on in the next row (lists.ts). */
export const LIST_GLSL = /* glsl */ `
vec4 entry(highp sampler2D list, int i) {
  int width = textureSize(list, 0).x;
  return texelFetch(list, ivec2(i % width, i / width), 0);
}
`;

export const RIGID_GLSL = /* glsl */ `
vec3 turn(vec4 q, vec3 v) {
  vec3 t = cross(q.xyz, v);
  return v + 2.0 * (q.w * t + cross(q.xyz, t));
}

vec4 times(vec4 a, vec4 b) {
  return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// sin and cos: quarter turns are taken off in two parts, the rest is a Taylor polynomial on [-pi/4, pi/4].
vec2 sineCosine(float x) {
  float k = floor(x * 0.636619772 + 0.5);
  float r = (x - k * 1.5707963705) + k * 4.3711390e-8;
  float u = r * r;
  float s = r * (1.0 + u * (-1.6666667e-1 + u * (8.3333333e-3 + u * (-1.9841270e-4 + u * 2.7557319e-6))));
  float c = 1.0 + u * (-0.5 + u * (4.1666667e-2 + u * (-1.3888889e-3 + u * (2.4801587e-5 - u * 2.7557319e-7))));
  int quarter = int(k) & 3;
  vec2 sc = (quarter & 1) == 0 ? vec2(s, c) : vec2(c, s);
  if (quarter == 1) return vec2(sc.x, -sc.y);
  if (quarter == 2) return -sc;
  if (quarter == 3) return vec2(-sc.x, sc.y);
  return sc;
}

void exponential(vec3 w, vec3 v, out vec4 q, out vec3 p) {
  float t2 = dot(w, w);
  float s, c, b, d;
  if (t2 < 0.36) {
    float u = 0.25 * t2;
    c = 1.0 + u * (-0.5 + u * (4.1666667e-2 + u * (-1.3888889e-3 + u * 2.4801587e-5)));
    s = 0.5 * (1.0 + u * (-1.6666667e-1 + u * (8.3333333e-3 + u * (-1.9841270e-4 + u * 2.7557319e-6))));
    b = 0.5 + t2 * (-4.1666667e-2 + t2 * (1.3888889e-3 + t2 * (-2.4801587e-5 + t2 * 2.7557319e-7)));
    d = 1.6666667e-1 + t2 * (-8.3333333e-3 + t2 * (1.9841270e-4 + t2 * (-2.7557319e-6 + t2 * 2.5052108e-8)));
  } else {
    float t = sqrt(t2);
    vec2 sc = sineCosine(0.5 * t);
    s = sc.x / t;
    c = sc.y;
    b = 2.0 * sc.x * sc.x / t2;
    d = (t - 2.0 * sc.x * sc.y) / (t2 * t);
  }
  vec3 wv = cross(w, v);
  q = vec4(s * w, c);
  p = v + b * wv + d * cross(w, wv);
}
`;

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
