// What the contact detector says of each pair of shapes, beside the truth: benchmarks/results/
// detector_accuracy.csv and the tables of docs/contact_detection.md.
//
//     build/release/benchmarks/detector_accuracy [--poses N] [--single] [PAIR...]       PAIR: box-mesh, ...
//
// 10,000 poses a pair and set, some ten minutes for all; with names only the rows of these are measured and
// written again. With --poses or --single (one point a pair) it prints the tables and writes nothing. Two
// sets: `random` orientations, and `resting` ones, whose axes are parallel but for a tilt of 1e-10 to 1e-2
// rad, as of things that lie on each other. Gaps lie between -4 mm and the margin of 30 mm. The truth: closed
// forms, else certified bounds (certified_gap.hpp).
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fork1s/collision/collision_world.hpp>
#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <sstream>

#include "base/percentile.hpp"
#include "benchmarks.hpp"
#include "certified_gap.hpp"

namespace fork1s::benchmarks::detector_accuracy {
namespace {

constexpr double kMargin = 0.03;    // m
constexpr double kDeepest = -4e-3;  // m
constexpr double kReach = 0.09;     // m, no shape reaches farther from its origin

struct Named {
  const char* name;
  Shape shape;
};

std::vector<Named> Shapes() {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->name = "mesh";
  for (int k = 0; k < 20; ++k) {
    const Vector3 v = Vector3(normal(random), normal(random), normal(random)).normalized();
    mesh->vertices.push_back(v.cwiseProduct(Vector3(0.06, 0.05, 0.04)).cast<float>());
  }
  // 0.8 x 0.8 m in cells of 25 mm that rise and fall by up to 10 mm.
  auto grid = std::make_shared<HeightGrid>();
  grid->name = "field";
  grid->rows = grid->columns = 33;
  grid->half_x = grid->half_y = 0.4;
  grid->max_height = 0.01;
  grid->base_depth = 0.1;
  std::uniform_real_distribution<float> height(0, 1);
  for (int k = 0; k < grid->rows * grid->columns; ++k) grid->values.push_back(height(random));
  return {{"plane", Plane{}},
          {"hfield", HeightField{grid}},
          {"sphere", Sphere{0.05}},
          {"capsule", Capsule{0.03, 0.04}},
          {"ellipsoid", Ellipsoid{Vector3(0.05, 0.04, 0.03)}},
          {"cylinder", Cylinder{0.04, 0.03}},
          {"box", Box{Vector3(0.05, 0.04, 0.03)}},
          {"mesh", MeshShape{mesh}}};
}

template <class T>
const T* As(const Shape& shape) {
  return std::get_if<T>(&shape);
}

// ------------------------------------------------------------------------------------------------ truth

double PointToSegment(const Vector3& p, const Vector3& a, const Vector3& b) {
  const Vector3 d = b - a;
  return (a + std::clamp((p - a).dot(d) / d.squaredNorm(), 0.0, 1.0) * d - p).norm();
}

double SegmentToSegment(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& d) {
  double least = std::min(
      {PointToSegment(a, c, d), PointToSegment(b, c, d), PointToSegment(c, a, b), PointToSegment(d, a, b)});
  const Vector3 u = b - a, v = d - c, w = c - a, n = u.cross(v);
  const double area = n.squaredNorm();
  if (area > 0) {
    const double s = w.cross(v).dot(n) / area, t = w.cross(u).dot(n) / area;
    if (s >= 0 && s <= 1 && t >= 0 && t <= 1) least = std::min(least, std::abs(w.dot(n)) / std::sqrt(area));
  }
  return least;
}

double PointToBox(const Vector3& p, const Vector3& half) {
  const Vector3 over = p.cwiseAbs() - half;
  return over.maxCoeff() > 0 ? over.cwiseMax(0).norm() : over.maxCoeff();
}

// Signed distances that have a formula; the first shape is the simpler one.
std::optional<double> ClosedForm(const Shape& a, const RigidTransform& X_A, const Shape& b,
                                 const RigidTransform& X_B) {
  const auto end = [](const Capsule& c, const RigidTransform& X, double side) {
    return X * Vector3(0, 0, side * c.half_length);
  };
  if (const auto* ball = As<Sphere>(a)) {
    const Vector3 p = X_B.inverse() * X_A.translation();
    if (const auto* s = As<Sphere>(b)) return p.norm() - s->radius - ball->radius;
    if (const auto* s = As<Capsule>(b))
      return PointToSegment(X_A.translation(), end(*s, X_B, -1), end(*s, X_B, 1)) - s->radius - ball->radius;
    if (const auto* s = As<Box>(b)) return PointToBox(p, s->half) - ball->radius;
    if (const auto* s = As<Cylinder>(b))  // a rectangle in the plane through the axis
      return PointToBox(Vector3(std::hypot(p.x(), p.y()), p.z(), 0), Vector3(s->radius, s->half_length, 1)) -
             ball->radius;
  }
  if (const auto *s = As<Capsule>(a), *t = As<Capsule>(b); s && t)
    return SegmentToSegment(end(*s, X_A, -1), end(*s, X_A, 1), end(*t, X_B, -1), end(*t, X_B, 1)) -
           s->radius - t->radius;
  return {};
}

// A height field as the prisms under its triangles.
class Field {
 public:
  Field(const HeightGrid& grid, const RigidTransform& X) : X_(X) {
    const auto point = [&](int row, int column) {
      return Vector3(
          2 * grid.half_x * column / (grid.columns - 1) - grid.half_x,
          2 * grid.half_y * row / (grid.rows - 1) - grid.half_y,
          grid.max_height *
              static_cast<double>(grid.values[static_cast<std::size_t>(row * grid.columns + column)]));
    };
    for (int i = 0; i + 1 < grid.rows; ++i)
      for (int k = 0; k + 1 < grid.columns; ++k)
        for (const bool lower : {true, false}) {
          Prism& prism = prisms_.emplace_back();
          prism.body.X = X;
          prism.body.points = {point(i, k), point(i + 1, k + 1), lower ? point(i, k + 1) : point(i + 1, k)};
          for (std::size_t v = 0; v < 3; ++v) {
            const Vector3 top = prism.body.points[v];
            prism.middle += top / 3;
            prism.body.points.push_back(Vector3(top.x(), top.y(), -grid.base_depth));
          }
        }
  }

  // The least gap over all prisms; certified as far as the worst of them is.
  CertifiedGap Gap(const ConvexBody& body) const {
    struct Candidate {
      double at_least;
      const Prism* prism;
    };
    std::vector<Candidate> near;
    const Vector3 c = X_.inverse() * body.X.translation();
    for (const Prism& prism : prisms_)
      if ((prism.middle - c).head<2>().norm() < kReach + kMargin + 0.03) {
        const Vector3 along = X_.rotation() * (c - prism.middle).normalized();
        near.push_back({GapAlong(prism.body, body, along), &prism});
      }
    std::sort(near.begin(), near.end(), [](const auto& a, const auto& b) { return a.at_least < b.at_least; });
    CertifiedGap least;
    least.gap = 1;
    double open = 0;
    for (const Candidate& candidate : near) {
      if (candidate.at_least > least.gap || GapAlong(candidate.prism->body, body, least.normal) > least.gap)
        continue;
      CertifyOptions options;
      options.enough = least.gap;
      const CertifiedGap gap = Certify(candidate.prism->body, body, options);
      if (gap.gap > least.gap) continue;
      open = std::max(open, gap.open);
      least = gap;
    }
    least.open = open;
    return least;
  }

 private:
  struct Prism {
    ConvexBody body;
    Vector3 middle = Vector3::Zero();
  };
  RigidTransform X_;
  std::vector<Prism> prisms_;
};

// ------------------------------------------------------------------------------------------------ detector

struct Answer {
  int points = 0;
  double gap = 0;  // the least
  Vector3 normal = Vector3::Zero();
  double us = 0;
};

class Detector {
 public:
  Detector(const Shape& a, bool a_moves, const RigidTransform& X_A, const Shape& b, bool multi_point)
      : a_moves_(a_moves), world_(Make(a, a_moves, X_A, b, multi_point)) {}

  Answer Detect(const RigidTransform& X_A, const RigidTransform& X_B) {
    if (a_moves_) world_.SetPose(0, X_A);
    world_.SetPose(1, X_B);
    Answer answer;
    const auto start = std::chrono::steady_clock::now();
    world_.Detect(contacts_);
    answer.us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
    answer.points = static_cast<int>(contacts_.size());
    const auto least = std::min_element(contacts_.begin(), contacts_.end(),
                                        [](const auto& c, const auto& d) { return c.gap < d.gap; });
    if (least != contacts_.end()) {
      answer.gap = least->gap;
      answer.normal = (least->body_a == 0 ? 1 : -1) * least->frame.row(0).transpose();
    }
    return answer;
  }

 private:
  static CollisionWorld Make(const Shape& a, bool a_moves, const RigidTransform& X_A, const Shape& b,
                             bool multi_point) {
    std::vector<CollisionBodyDef> bodies(2);
    bodies[0].name = "a";
    bodies[0].moves = a_moves;
    bodies[0].X_WB = X_A;
    bodies[1].name = "b";
    bodies[0].geometries.resize(1);
    bodies[0].geometries[0].shape = a;
    bodies[1].geometries.resize(1);
    bodies[1].geometries[0].shape = b;
    return CollisionWorld::Create(bodies, {}, {.margin = kMargin, .multi_point = multi_point}).value();
  }
  bool a_moves_;
  CollisionWorld world_;
  std::vector<ContactPoint> contacts_;
};

// ------------------------------------------------------------------------------------------------ a pair

struct Row {
  std::string set, a, b;
  int poses = 0, left_out = 0, missed = 0, wrong = 0, points_max = 0;
  double points = 0;
  std::vector<double> gap_mm, slack_mm, normal_deg, us;
  double formula_mm = 0;  // largest difference of certified bounds and closed form
};

constexpr double kPi = 3.14159265358979323846;

class Poses {
 public:
  explicit Poses(bool resting) : resting_(resting) {}
  double Uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  Vector3 Direction() { return Vector3(normal_(random_), normal_(random_), normal_(random_)).normalized(); }
  Matrix3 Turn() { return ExpRotation(Uniform(0, kPi) * Direction()); }
  // Of a shape beside one of the orientation R_A.
  Matrix3 Beside(const Matrix3& R_A) {
    if (!resting_)
      return Quaternion(Eigen::Vector4d::NullaryExpr([&](auto) { return normal_(random_); }))
          .normalized()
          .toRotationMatrix();
    Matrix3 R = R_A;
    for (int axis = 0; axis < 3; ++axis)
      R = R * ExpRotation(std::floor(Uniform(0, 4)) * kPi / 2 * Vector3::Unit(axis));
    return R * ExpRotation(std::pow(10, Uniform(-10, -2)) * Direction());
  }
  // From the origin of a to that of b, far enough that they do not touch.
  Vector3 Offset(const Matrix3& R_A) {
    if (!resting_) return 2.2 * kReach * Direction();
    Vector3 offset(Uniform(-0.05, 0.05), Uniform(-0.05, 0.05), Uniform(-0.05, 0.05));
    offset[static_cast<int>(Uniform(0, 3))] = Uniform(0, 1) < 0.5 ? -2.2 * kReach : 2.2 * kReach;
    return R_A * offset;
  }

 private:
  bool resting_;
  std::mt19937 random_{7};
  std::normal_distribution<double> normal_;
};

Row MeasurePair(const Named& a, const Named& b, bool resting, int count, bool multi_point) {
  Row row;
  row.set = resting ? "resting" : "random";
  row.a = a.name;
  row.b = b.name;
  Poses poses(resting);
  const bool plane = As<Plane>(a.shape) != nullptr, field = As<HeightField>(a.shape) != nullptr;
  RigidTransform X_A(poses.Turn(), 0.1 * poses.Direction());
  Detector detector(a.shape, !plane && !field, X_A, b.shape, multi_point);
  std::optional<Field> ground;
  if (field) ground.emplace(*As<HeightField>(a.shape)->grid, X_A);
  ConvexBody body_a = MakeConvexBody(a.shape), body_b = MakeConvexBody(b.shape);
  const bool round = body_b.radius > 0;
  const auto truth = [&]() -> CertifiedGap {
    body_a.X = X_A;
    if (field) return ground->Gap(body_b);
    if (!plane) return Certify(body_a, body_b);
    CertifiedGap gap;
    gap.normal = X_A.rotation().col(2);
    gap.gap = gap.normal.dot(body_b.Farthest(-gap.normal) - X_A.translation()) - body_b.radius;
    return gap;
  };

  while (row.poses < count) {
    // Apart, and then along the normal: at the wanted gap, whatever the features that are nearest.
    if (!plane && !field) X_A = RigidTransform(poses.Turn(), 0.1 * poses.Direction());
    const Matrix3& R_A = X_A.rotation();
    Vector3 offset = poses.Offset(R_A);
    if (plane || field)
      offset = R_A * Vector3(poses.Uniform(-0.2, 0.2), poses.Uniform(-0.2, 0.2), 2.2 * kReach);
    body_b.X = RigidTransform(poses.Beside(R_A), X_A.translation() + offset);
    const double from = field && !round ? 0 : kDeepest;  // of a field no depth is defined
    if (field) body_b.X = RigidTransform(body_b.X.rotation(), body_b.X.translation() - 0.09 * R_A.col(2));
    CertifiedGap gap = truth();
    body_b.X = RigidTransform(body_b.X.rotation(),
                              body_b.X.translation() + (poses.Uniform(from, kMargin) - gap.gap) * gap.normal);
    gap = truth();
    if (gap.gap >= kMargin || gap.gap < 2 * kDeepest || (field && !round && gap.gap < 0)) continue;
    ++row.poses;
    if (gap.open > 1e-10) {  // faces to a hair parallel, in penetration
      ++row.left_out;
      continue;
    }
    if (const auto formula = ClosedForm(a.shape, X_A, b.shape, body_b.X)) {
      row.formula_mm = std::max(row.formula_mm, 1e3 * std::abs(*formula - gap.gap));
      gap.gap = *formula;
    }

    const Answer answer = detector.Detect(X_A, body_b.X);
    row.us.push_back(answer.us);
    row.points += answer.points;
    row.points_max = std::max(row.points_max, answer.points);
    if (answer.points == 0) {
      if (gap.gap < kMargin - 1e-6) ++row.missed;
      continue;
    }
    const double error = std::abs(answer.gap - gap.gap);
    row.gap_mm.push_back(1e3 * error);
    if (error > 1e-5) ++row.wrong;
    if (!field) {
      const double proves = plane ? gap.gap - kReach * (answer.normal - gap.normal).norm()
                                  : GapAlong(body_a, body_b, answer.normal);
      row.slack_mm.push_back(1e3 * std::max(0.0, gap.gap - proves));
    }
    // Near zero the gap says little about the normal; on a field the nearest faces of several prisms differ.
    if (std::abs(gap.gap) > 1e-3)
      row.normal_deg.push_back(180 / kPi * 2 *
                               std::asin(std::min(1.0, (answer.normal - gap.normal).norm() / 2)));
  }
  return row;
}

std::string Head() {
  return "set,a,b,poses,left_out,missed,wrong,gap_median_mm,gap_p99_mm,gap_max_mm,slack_p99_mm,slack_max_mm,"
         "normal_median_deg,normal_p99_deg,normal_max_deg,points_mean,points_max,us\n";
}

std::string Line(const Row& r) {
  const auto at = [](const std::vector<double>& values, double share) {
    return values.empty() ? std::string() : fmt::format("{:.2g}", Percentile(values, share));
  };
  return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.3g},{},{:.3g}\n", r.set, r.a, r.b,
                     r.poses, r.left_out, r.missed, r.wrong, at(r.gap_mm, 0.5), at(r.gap_mm, 0.99),
                     at(r.gap_mm, 1), at(r.slack_mm, 0.99), at(r.slack_mm, 1), at(r.normal_deg, 0.5),
                     at(r.normal_deg, 0.99), at(r.normal_deg, 1),
                     r.points / static_cast<double>(std::max<std::size_t>(1, r.us.size())), r.points_max,
                     Percentile(r.us, 0.5));
}

std::string TableHead(const char* set) {
  return fmt::format(
      "\n{}:\n\n| pair | missed | > 0.01 mm off | gap error, mm: median | 99 % | max | normal, degrees: "
      "median | 99 % "
      "| points | µs |\n|---|---|---|---|---|---|---|---|---|---|\n",
      set);
}

std::string TableLine(const Row& r) {
  const auto at = [](const std::vector<double>& values, double share) {
    return values.empty() ? std::string("-") : fmt::format("{:.1g}", Percentile(values, share));
  };
  return fmt::format(
      "| {} - {} | {} | {} | {} | {} | {} | {} | {} | {:.2g} | {:.2g} |\n", r.a, r.b, r.missed, r.wrong,
      at(r.gap_mm, 0.5), at(r.gap_mm, 0.99), at(r.gap_mm, 1), at(r.normal_deg, 0.5), at(r.normal_deg, 0.99),
      r.points / static_cast<double>(std::max<std::size_t>(1, r.us.size())), Percentile(r.us, 0.5));
}

// The file with these rows in place of its own of the same set and pair.
std::string Renewed(const std::string& path, const std::string& rows) {
  const auto pair = [](const std::string& line) {
    std::size_t at = line.find(',');
    for (int k = 0; k < 2 && at != std::string::npos; ++k) at = line.find(',', at + 1);
    return line.substr(0, at);
  };
  std::map<std::string, std::string> measured;
  std::istringstream lines(rows);
  std::string line, out;
  while (std::getline(lines, line)) measured[pair(line)] = line;
  std::ifstream file(path);
  while (std::getline(file, line)) {
    const auto now = measured.find(pair(line));
    out += (now == measured.end() ? line : now->second) + "\n";
  }
  return out;
}

}  // namespace

int Main(int argc, char** argv) {
  int count = 10000;
  bool multi_point = true, all_poses = true;
  std::vector<std::string> wanted;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--poses" && i + 1 < argc) {
      count = std::max(1, std::atoi(argv[++i]));
      all_poses = false;
    } else if (argument == "--single") {
      multi_point = false;
    } else if (argument.starts_with("-")) {
      fmt::print(stderr, "usage: detector_accuracy [--poses N] [--single] [PAIR...]\n");
      return 1;
    } else {
      wanted.push_back(argument);
    }
  }
  const std::vector<Named> shapes = Shapes();
  std::string csv;
  double formula_mm = 0;
  int left_out = 0;
  for (const bool resting : {false, true}) {
    fmt::print("{}", TableHead(resting ? "Resting" : "Random"));
    for (std::size_t i = 0; i < shapes.size(); ++i)
      for (std::size_t k = std::max<std::size_t>(i, 2); k < shapes.size(); ++k) {
        const std::string name = fmt::format("{}-{}", shapes[i].name, shapes[k].name);
        if (!wanted.empty() && std::find(wanted.begin(), wanted.end(), name) == wanted.end()) continue;
        const Row row = MeasurePair(shapes[i], shapes[k], resting, count, multi_point);
        fmt::print("{}", TableLine(row));
        std::fflush(stdout);
        csv += Line(row);
        formula_mm = std::max(formula_mm, row.formula_mm);
        left_out += row.left_out;
      }
  }
  fmt::print("\nPoses without proof, left out: {}. Proof and closed form differ by {:.1g} mm at most.\n",
             left_out, formula_mm);
  if (!all_poses || !multi_point) return 0;
  const std::string path = std::string(FORK1S_SOURCE) + "/benchmarks/results/detector_accuracy.csv";
  const std::string text = wanted.empty() ? Head() + csv : Renewed(path, csv);
  std::ofstream file(path, std::ios::trunc);
  file << text;
  if (!file) {
    fmt::print(stderr, "{} cannot be written\n", path);
    return 1;
  }
  return 0;
}

}  // namespace fork1s::benchmarks::detector_accuracy
