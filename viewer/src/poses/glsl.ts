// Rigid motions on the GPU. sin and cos of GPUs may be wrong by 1e-4, so the exponential uses polynomials: about
// 1e-7 in single precision. The equations are those of rigid.ts.

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

/** One fragment a joint coordinate and copy: q = rest + Q z. */
export const COORDINATE_SHADER = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D rests;      // coordinates x copies: q_ref + correction
uniform sampler2D maps;       // ceil(r/4) x coordinates: Q
uniform sampler2D reduced;    // ceil(r/4) x (roots * copies): z
uniform sampler2D rootOf;     // coordinates x 1
uniform int roots;
uniform int blocks;
layout(location = 0) out vec4 result;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  int root = int(texelFetch(rootOf, ivec2(at.x, 0), 0).x);
  float q = texelFetch(rests, at, 0).x;
  for (int k = 0; k < blocks; ++k)
    q += dot(texelFetch(maps, ivec2(k, at.x), 0), texelFetch(reduced, ivec2(k, at.y * roots + root), 0));
  result = vec4(q, 0.0, 0.0, 1.0);
}
`;

/** One fragment a body and copy: exact walks the body's path, twist takes one exponential. */
export const POSE_SHADER = /* glsl */ `
precision highp float;
precision highp sampler2D;
uniform sampler2D bodies;       // bodies x 3: (root, last joint), quaternion, position at q = 0
uniform sampler2D joints;       // joints x 1: (previous, offset, size)
uniform sampler2D screws;       // coordinates x 2: angular, linear
uniform sampler2D coordinates;  // coordinates x copies
uniform sampler2D reduced;
uniform sampler2D twists;       // 2 r x bodies: T_B, angular and linear part of each column
uniform sampler2D references;   // bodies x 2: quaternion, position at q_ref
uniform sampler2D bases;        // 2 x (roots * copies): quaternion, position
uniform int roots;
uniform int blocks;
uniform bool twistMode;
layout(location = 0) out vec4 quaternion;
layout(location = 1) out vec4 position;
${RIGID_GLSL}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 info = texelFetch(bodies, ivec2(at.x, 0), 0);
  int root = int(info.x);
  vec4 q = texelFetch(bodies, ivec2(at.x, 1), 0);
  vec3 p = texelFetch(bodies, ivec2(at.x, 2), 0).xyz;
  vec4 dq;
  vec3 dp;
  if (twistMode && info.z > 0.5) {
    vec3 w = vec3(0.0), v = vec3(0.0);
    for (int k = 0; k < blocks; ++k) {
      vec4 z = texelFetch(reduced, ivec2(k, at.y * roots + root), 0);
      for (int c = 0; c < 4; ++c) {
        w += z[c] * texelFetch(twists, ivec2(2 * (4 * k + c), at.x), 0).xyz;
        v += z[c] * texelFetch(twists, ivec2(2 * (4 * k + c) + 1, at.x), 0).xyz;
      }
    }
    exponential(w, v, dq, dp);
    q = times(dq, texelFetch(references, ivec2(at.x, 0), 0));
    p = turn(dq, texelFetch(references, ivec2(at.x, 1), 0).xyz) + dp;
  } else {
    int joint = int(info.y);
    while (joint >= 0) {
      vec4 j = texelFetch(joints, ivec2(joint, 0), 0);
      vec3 w = vec3(0.0), v = vec3(0.0);
      int first = int(j.y), size = int(j.z);
      for (int i = 0; i < size; ++i) {
        float x = texelFetch(coordinates, ivec2(first + i, at.y), 0).x;
        w += x * texelFetch(screws, ivec2(first + i, 0), 0).xyz;
        v += x * texelFetch(screws, ivec2(first + i, 1), 0).xyz;
      }
      exponential(w, v, dq, dp);
      q = times(dq, q);
      p = turn(dq, p) + dp;
      joint = int(j.x);
    }
  }
  dq = texelFetch(bases, ivec2(0, at.y * roots + root), 0);
  dp = texelFetch(bases, ivec2(1, at.y * roots + root), 0).xyz;
  quaternion = normalize(times(dq, q));
  position = vec4(turn(dq, p) + dp, 1.0);
}
`;

export const FULLSCREEN_VERTEX = /* glsl */ `
in vec3 position;
void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }
`;
