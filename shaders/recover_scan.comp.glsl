#version 310 es
#extension GL_GOOGLE_include_directive : enable
// Between the two passes of exact recovery, as often as the host likes, for long chains: every link takes the motion of the
// link before it into its own, and then stands after the one before that. Each time a link covers twice as many; after
// ceil(log2(longest path)) times all of them. From one buffer into the other, which change places.
#include "buffers.glsl"
#include "rigid.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 3) readonly buffer Links { Motion links[]; };
layout(std430, binding = 4) buffer Longer { Motion longer[]; };

void main() {
  int i = int(gl_GlobalInvocationID.x);
  if (i >= tables[LINKS]) return;
  Motion own = links[i];
  int before = int(own.position.w);
  if (before >= 0) {
    Motion far = links[before];
    own = Motion(normalize(times(far.quaternion, own.quaternion)),
                 vec4(turn(far.quaternion, own.position.xyz) + far.position.xyz, far.position.w));
  }
  longer[i] = own;
}
