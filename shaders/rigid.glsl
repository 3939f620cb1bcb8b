// Rigid motions: unit quaternions x y z w with positions, and the exponential of a twist.
//
// GLSL ES 3.00 and later; the page of `fork1s view` draws with this file too. Sines and cosines of graphics processors may be
// off by 1e-4, so these are polynomials: rotations come out within 1e-6 rad for turns up to ten radians, most of it the
// rounding of the turn itself, and within 1e-7 of the turn beyond (tests/gpu/rigid_test.cpp).

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

// Exp of the twist [w; v]: a turn by |w| about w, and p = v + b w x v + d w x (w x v).
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
