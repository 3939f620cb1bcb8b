// What all passes read: docs/engines.md has the layout as tables.
precision highp float;
precision highp int;

layout(std430, binding = 0) readonly buffer Tables { int tables[]; };      // sizes, and where numbers stand
layout(std430, binding = 1) readonly buffer Numbers { float numbers[]; };  // the model about its reference

const int LINKS = 2, BODIES = 3;                                // sizes among the first sixteen tables
int linkTable(int i) { return 16 + 4 * i; }                     // before, first coordinate, coordinates, root
int coordinateTable(int i) { return tables[6] + 8 * i; }        // z, count, row of Q, curve, correction, screw
int bodyTable(int i) { return tables[7] + 8 * i; }              // root, last link, z, count, T, reference, pose at q = 0

vec3 vectorAt(int i) { return vec3(numbers[i], numbers[i + 1], numbers[i + 2]); }
vec4 quaternionAt(int i) { return vec4(vectorAt(i), numbers[i + 3]); }

struct Motion {
  vec4 quaternion;  // x y z w
  vec4 position;    // x y z [m]; of a link the fourth number is the link before it, -1 at the root
};
