// What changes from frame to frame: eight numbers a root (quaternion, position, 0), then z, then corrections.
layout(std430, binding = 2) readonly buffer Frame { float frame[]; };

Motion baseOf(int root) {
  int i = 8 * root;
  return Motion(vec4(frame[i], frame[i + 1], frame[i + 2], frame[i + 3]),
                vec4(frame[i + 4], frame[i + 5], frame[i + 6], -1.0));
}
