#include "sketch.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>
#include <utility>

namespace fork1s::linkages {

int Sketch::AddBody(const RigidTransform& X_SB, const SpatialInertia& I) {
  X.push_back(X_SB);
  inertia.push_back(I);
  return static_cast<int>(X.size()) - 1;
}

Pair& Sketch::AddPair(int a, int b, PairKind kind, const Vector3& point, const Matrix3& frame) {
  pairs.emplace_back();
  Pair& pair = pairs.back();
  pair.a = a;
  pair.b = b;
  pair.kind = kind;
  pair.point = point;
  pair.frame = frame;
  return pair;
}

Matrix3 FrameAlong(const Vector3& axis) {
  const Vector3 z = axis.normalized();
  const Vector3 helper = std::abs(z.x()) < 0.7 ? Vector3::UnitX() : Vector3::UnitY();
  Matrix3 R;
  R.col(0) = z.cross(helper).normalized();
  R.col(1) = z.cross(R.col(0)).normalized();
  R.col(2) = z;
  return R;
}

Sketch Scaled(Sketch s, double factor) {
  for (RigidTransform& X : s.X) X.translation() *= factor;
  for (SpatialInertia& I : s.inertia) I.center *= factor, I.rotational *= factor * factor;
  for (Pair& p : s.pairs) {
    p.point *= factor;
    p.k_slide /= factor * factor;
  }
  auto unit = [&](int pair) {
    return s.pairs[static_cast<std::size_t>(pair)].kind == PairKind::kSlide ? factor : 1.0;
  };
  // Lengths of tendons are angles: their stiffness stays.
  for (Tendon& t : s.tendons)
    for (TendonTerm& term : t.terms) term.coefficient /= unit(term.pair);
  for (GearPair& g : s.gears) {
    g.slope *= unit(g.a) / unit(g.b);
    g.bend *= unit(g.a) / (unit(g.b) * unit(g.b));
  }
  s.X_WS.translation() *= factor;
  s.size *= factor;
  return s;
}

Sketch WithRoot(Sketch s, const RigidTransform& X_SR) {
  s.X[0] = X_SR;
  return s;
}

Sketch Moved(Sketch s, const RigidTransform& X_WS) {
  s.X_WS = X_WS;
  return s;
}

namespace {

struct Tree {
  std::vector<int> order;      // bodies, parents first
  std::vector<int> parent;     // of each body of the sketch
  std::vector<int> pair_of;    // that holds it
  std::vector<bool> is_joint;  // of each pair
};

// Kruskal on the pairs in a random order, those that must be joints first.
Tree Span(const Sketch& s, const Writing& writing, std::mt19937& engine) {
  const std::size_t n = s.X.size();
  std::vector<std::size_t> pairs(s.pairs.size());
  std::iota(pairs.begin(), pairs.end(), 0u);
  auto shuffle = [&](auto& list) {
    for (std::size_t i = list.size(); i > 1; --i) std::swap(list[i - 1], list[engine() % i]);
  };
  if (!writing.keep_order) shuffle(pairs);
  auto rank = [&](std::size_t k) {
    const Pair& p = s.pairs[k];
    return (p.in_tree ? 2 : 0) + (writing.sprung_joints && (p.k_turn > 0 || p.k_slide > 0) ? 1 : 0);
  };
  std::stable_sort(pairs.begin(), pairs.end(),
                   [&](std::size_t a, std::size_t b) { return rank(a) > rank(b); });
  std::vector<int> set(n);
  std::iota(set.begin(), set.end(), 0);
  Tree tree;
  tree.is_joint.assign(s.pairs.size(), false);
  for (std::size_t k : pairs) {
    const Pair& p = s.pairs[k];
    const int a = set[static_cast<std::size_t>(p.a)], b = set[static_cast<std::size_t>(p.b)];
    if (p.kind == PairKind::kBushing || a == b) continue;
    tree.is_joint[k] = true;
    std::replace(set.begin(), set.end(), b, a);
  }
  tree.parent.assign(n, -1);
  tree.pair_of.assign(n, -1);
  tree.order = {0};
  std::vector<bool> reached(n, false);
  reached[0] = true;
  while (tree.order.size() < n) {
    if (!writing.keep_order) shuffle(pairs);
    const std::size_t before = tree.order.size();
    for (std::size_t k : pairs) {
      if (!tree.is_joint[k]) continue;
      int from = s.pairs[k].a, to = s.pairs[k].b;
      if (reached[static_cast<std::size_t>(to)]) std::swap(from, to);
      if (!reached[static_cast<std::size_t>(from)] || reached[static_cast<std::size_t>(to)]) continue;
      reached[static_cast<std::size_t>(to)] = true;
      tree.parent[static_cast<std::size_t>(to)] = from;
      tree.pair_of[static_cast<std::size_t>(to)] = static_cast<int>(k);
      tree.order.push_back(to);
      break;
    }
    if (tree.order.size() == before) throw std::logic_error("a body of the sketch hangs on nothing");
  }
  return tree;
}

JointDef JointOfPair(const Pair& p, const std::string& name, BodyIndex body, const RigidTransform& X_RB,
                     const RigidTransform& X_RS) {
  const Matrix3 frame_B = X_RB.rotation().transpose() * X_RS.rotation() * p.frame;
  const Vector3 point_B = X_RB.inverse() * (X_RS * p.point);
  const Vector3 axis = frame_B.col(2);
  JointDef joint;
  switch (p.kind) {
    case PairKind::kHinge:
      joint = JointDef::Hinge(name, body, axis, point_B);
      break;
    case PairKind::kSlide:
      joint = JointDef::Slide(name, body, axis);
      break;
    case PairKind::kBall:
      joint = JointDef::Ball(name, body, point_B);
      break;
    case PairKind::kCylindrical:
      joint = JointDef::Cylindrical(name, body, axis, point_B);
      break;
    case PairKind::kPlanar:
      joint = JointDef::Planar(name, body, axis, point_B);
      break;
    default: {
      Matrix6X S(6, 2);
      for (int i = 0; i < 2; ++i) S.col(i) << frame_B.col(i), point_B.cross(frame_B.col(i));
      joint = JointDef::General(name, body, S);
    }
  }
  for (FreedomDef& f : joint.freedoms) {
    f.stiffness = f.screw_B.head<3>().squaredNorm() > 0.5 ? p.k_turn : p.k_slide;
    f.damping = 0.01 * f.stiffness;
    if (!p.armature.empty()) f.armature = p.armature[0];
  }
  return joint;
}

ClosureDef ClosureOf(const Pair& p, const std::string& name) {
  ClosureDef c;
  c.name = name;
  switch (p.kind) {
    case PairKind::kHinge:
      c.rigid << true, true, false, true, true, true;
      break;
    case PairKind::kSlide:
      c.rigid << true, true, true, true, true, false;
      break;
    case PairKind::kBall:
      c.rigid << false, false, false, true, true, true;
      break;
    case PairKind::kCylindrical:
      c.rigid << true, true, false, true, true, false;
      break;
    case PairKind::kUniversal:
      c.rigid << false, false, true, true, true, true;
      break;
    case PairKind::kPlanar:
      c.rigid << true, true, false, false, false, true;
      break;
    case PairKind::kWeld:
      c.rigid.setConstant(true);
      break;
    case PairKind::kBushing:
      break;
  }
  for (int i = 0; i < 6; ++i)
    if (!c.rigid(i) && (p.kind != PairKind::kBushing || (p.bushing >> i & 1u)))
      c.stiffness(i) = i < 3 ? p.k_turn : p.k_slide;
  c.damping = 0.01 * c.stiffness;
  return c;
}

}  // namespace

MechanismDef Write(const Sketch& s, const Writing& writing) {
  std::mt19937 engine(writing.seed * 2654435761u + 7u);
  const Tree tree = Span(s, writing, engine);
  const RigidTransform X_RS = s.X[0].inverse();
  const std::string body_prefix = writing.other_names ? "limb " : "b",
                    pair_prefix = writing.other_names ? "pin " : "p";
  auto body_name = [&](int b) { return body_prefix + std::to_string(b); };

  MechanismDef def;
  def.name = s.family;
  def.X_WR = s.X_WS * s.X[0];
  std::vector<BodyIndex> place(s.X.size());
  for (int b : tree.order) {
    BodyDef body;
    body.name = body_name(b);
    body.inertia = s.inertia[static_cast<std::size_t>(b)];
    if (b != 0) {
      const auto parent = static_cast<std::size_t>(tree.parent[static_cast<std::size_t>(b)]);
      body.parent = place[parent];
      body.X_PB = s.X[parent].inverse() * s.X[static_cast<std::size_t>(b)];
    }
    place[static_cast<std::size_t>(b)] = BodyIndex(def.bodies.size());
    def.bodies.push_back(std::move(body));
  }

  // Where the mechanism has the bodies, rounding included: closures are closed there.
  std::vector<RigidTransform> X_RB(s.X.size());
  {
    MechanismDef bodies_only = def;
    const auto built = BuildMechanism(bodies_only);
    if (!built) throw std::logic_error(built.error().Text());
    for (std::size_t b = 0; b < s.X.size(); ++b) X_RB[b] = built->body(place[b]).X_RB0;
  }

  std::vector<int> joint_pairs;
  for (int b : tree.order) {
    if (b == 0) continue;
    const int k = tree.pair_of[static_cast<std::size_t>(b)];
    if (s.pairs[static_cast<std::size_t>(k)].kind != PairKind::kWeld) joint_pairs.push_back(k);
  }
  if (!writing.keep_order)
    for (std::size_t i = joint_pairs.size(); i > 1; --i)
      std::swap(joint_pairs[i - 1], joint_pairs[engine() % i]);
  std::vector<int> joint_of(s.pairs.size(), -1);
  std::vector<double> sign(s.pairs.size(), 1);
  for (int k : joint_pairs) {
    const auto pair = static_cast<std::size_t>(k);
    const Pair& p = s.pairs[pair];
    const int child = tree.pair_of[static_cast<std::size_t>(p.b)] == k ? p.b : p.a;
    sign[pair] = child == p.b ? 1 : -1;
    joint_of[pair] = static_cast<int>(def.joints.size());
    def.joints.push_back(JointOfPair(p, pair_prefix + std::to_string(k),
                                     place[static_cast<std::size_t>(child)],
                                     X_RB[static_cast<std::size_t>(child)], X_RS));
  }
  for (std::size_t k = 0; k < s.pairs.size(); ++k) {
    if (tree.is_joint[k]) continue;
    const Pair& p = s.pairs[k];
    ClosureDef c = ClosureOf(p, pair_prefix + std::to_string(k));
    int a = p.a, b = p.b;
    if (!writing.keep_order && engine() % 2) std::swap(a, b);
    c.body_a = place[static_cast<std::size_t>(a)];
    c.body_b = place[static_cast<std::size_t>(b)];
    const RigidTransform X_RJ = X_RS * RigidTransform(p.frame, p.point);
    c.X_AJ = X_RB[static_cast<std::size_t>(a)].inverse() * X_RJ;
    c.X_BJ = X_RB[static_cast<std::size_t>(b)].inverse() * X_RB[static_cast<std::size_t>(a)] * c.X_AJ;
    def.closures.push_back(std::move(c));
  }

  auto reference = [&](int pair) {
    return FreedomRef{JointIndex(joint_of[static_cast<std::size_t>(pair)]), 0};
  };
  for (const Tendon& t : s.tendons) {
    SpringDef spring;
    spring.name = "tendon" + std::to_string(def.springs.size());
    for (const TendonTerm& term : t.terms)
      spring.terms.emplace_back(reference(term.pair),
                                sign[static_cast<std::size_t>(term.pair)] * term.coefficient);
    spring.stiffness = t.stiffness;
    def.springs.push_back(std::move(spring));
  }
  for (const GearPair& g : s.gears) {
    CouplingDef c;
    c.name = "gear" + std::to_string(def.couplings.size());
    c.a = reference(g.a);
    c.b = reference(g.b);
    const double sa = sign[static_cast<std::size_t>(g.a)], sb = sign[static_cast<std::size_t>(g.b)];
    c.polynomial[1] = sa * sb * g.slope;
    c.polynomial[2] = sa * g.bend;
    def.couplings.push_back(c);
  }
  for (int b : s.interfaces) def.interfaces.push_back(body_name(b));
  return def;
}

Written Build(const Sketch& sketch, const Writing& writing) {
  auto built = BuildMechanism(Write(sketch, writing));
  if (!built) throw std::runtime_error(sketch.family + ": " + built.error().Text());
  Written written{std::make_shared<const Mechanism>(std::move(*built)), {}};
  for (const std::string& name : written.mechanism->definition().interfaces)
    written.interfaces.push_back(written.mechanism->FindBody(name));
  return written;
}

}  // namespace fork1s::linkages
