#version 310 es
#extension GL_GOOGLE_include_directive : enable
// One invocation a body: X_WB = X_WR Exp(T_B z) X_RB(q_ref), whatever the depth of the body.
#include "buffers.glsl"
#include "frame.glsl"
#include "rigid.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 5) buffer Poses { Motion poses[]; };

void main() {
  int body = int(gl_GlobalInvocationID.x);
  if (body >= tables[BODIES]) return;
  int at = bodyTable(body);
  int z = tables[at + 2], count = tables[at + 3], column = tables[at + 4], reference = tables[at + 5];
  vec3 w = vec3(0.0), v = vec3(0.0);
  for (int k = 0; k < count; ++k, column += 6) {
    w += frame[z + k] * vectorAt(column);
    v += frame[z + k] * vectorAt(column + 3);
  }
  vec4 q;
  vec3 p;
  exponential(w, v, q, p);
  p += turn(q, vectorAt(reference + 4));
  q = times(q, quaternionAt(reference));
  Motion base = baseOf(tables[at]);
  poses[body] = Motion(normalize(times(base.quaternion, q)), vec4(turn(base.quaternion, p) + base.position.xyz, 1.0));
}
