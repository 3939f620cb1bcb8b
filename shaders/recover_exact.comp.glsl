#version 310 es
#extension GL_GOOGLE_include_directive : enable
// Last pass of exact and curved recovery, one invocation a body: the motions of the links on its way from the root, and the
// pose that it has where they do not move. It walks what passes of recover_scan have left: without any, the whole path.
#include "buffers.glsl"
#include "rigid.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 3) readonly buffer Links { Motion links[]; };
layout(std430, binding = 5) buffer Poses { Motion poses[]; };

void main() {
  int body = int(gl_GlobalInvocationID.x);
  if (body >= tables[BODIES]) return;
  int at = bodyTable(body);
  int still = tables[at + 6];
  vec4 q = quaternionAt(still);
  vec3 p = vectorAt(still + 4);
  int link = tables[at + 1];
  while (link >= 0) {
    Motion motion = links[link];
    q = times(motion.quaternion, q);
    p = turn(motion.quaternion, p) + motion.position.xyz;
    link = int(motion.position.w);
  }
  poses[body] = Motion(normalize(q), vec4(p, 1.0));
}
