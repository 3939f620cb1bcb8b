#version 310 es
#extension GL_GOOGLE_include_directive : enable
// First pass of exact and curved recovery, one invocation a link: the motion of a base, X_WR, or of a joint, Exp(S q) with
// q = q_ref + Q z + correction. Loops closed by their curvature add z H z with H = -1/2 B N of that coordinate.
#include "buffers.glsl"
#include "frame.glsl"
#include "rigid.glsl"

layout(local_size_x = 64) in;
layout(std430, binding = 3) buffer Links { Motion links[]; };

float displacement(int at, float rest) {
  int z = tables[at], count = tables[at + 1], row = tables[at + 2], curve = tables[at + 3], correction = tables[at + 4];
  float moved = correction < 0 ? 0.0 : frame[correction];
  for (int k = 0; k < count; ++k) moved += numbers[row + k] * frame[z + k];
  if (curve >= 0) {
    float bend = 0.0;
    for (int k = 0; k < count; ++k) {  // the upper triangle, row by row
      float sum = 0.0;
      for (int l = k; l < count; ++l) sum += numbers[curve++] * frame[z + l];
      bend += frame[z + k] * sum;
    }
    moved += bend;
  }
  return rest + moved;
}

void main() {
  int link = int(gl_GlobalInvocationID.x);
  if (link >= tables[LINKS]) return;
  int at = linkTable(link);
  int before = tables[at], first = tables[at + 1], count = tables[at + 2];
  if (before < 0) {
    links[link] = baseOf(tables[at + 3]);
    return;
  }
  vec3 w = vec3(0.0), v = vec3(0.0);
  for (int i = first; i < first + count; ++i) {
    int coordinate = coordinateTable(i);
    int screw = tables[coordinate + 5];
    float q = displacement(coordinate, numbers[screw + 6]);
    w += q * vectorAt(screw);
    v += q * vectorAt(screw + 3);
  }
  vec4 q;
  vec3 p;
  exponential(w, v, q, p);
  links[link] = Motion(q, vec4(p, float(before)));
}
