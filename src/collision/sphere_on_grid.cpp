#include "sphere_on_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fork1s/spatial/rigid_transform.hpp>
#include <utility>

namespace fork1s::internal {
namespace {

using Triangle = std::array<Vector3, 3>;

// A point of a triangle, and how far the centre is from it: negative under the face.
struct Nearest {
  Triangle triangle;
  Vector3 up;             // of the triangle
  Vector3 point, normal;  // of the contact
  double distance = 0;
};

Vector3 AreaNormal(const Triangle& t) { return (t[1] - t[0]).cross(t[2] - t[0]); }
Vector3 Up(const Triangle& t) { return AreaNormal(t).normalized(); }

Vector3 OnSegment(const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 d = b - a;
  return a + std::clamp((c - a).dot(d) / d.squaredNorm(), 0.0, 1.0) * d;
}

// The point of a triangle nearest to c; n: Up(t).
Vector3 ClosestPoint(const Triangle& t, const Vector3& n, const Vector3& c) {
  bool inside = true;
  Vector3 best = t[0];
  double least = 1e300;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3 &a = t[i], &b = t[(i + 1) % 3];
    if (n.cross(b - a).dot(c - a) >= 0) continue;
    inside = false;
    const Vector3 p = OnSegment(a, b, c);
    if (const double d = (p - c).squaredNorm(); d < least) {
      least = d;
      best = p;
    }
  }
  return inside ? Vector3(c - n.dot(c - t[0]) * n) : best;
}

Vector3 ClosestPoint(const Triangle& t, const Vector3& c) { return ClosestPoint(t, Up(t), c); }

// Whether a triangle of the normal n has the point p.
bool IsOn(const Triangle& t, const Vector3& n, const Vector3& p, double tolerance) {
  if (std::abs(n.dot(p - t[0])) > tolerance) return false;
  for (int axis : {0, 1}) {
    const auto [low, high] = std::minmax({t[0][axis], t[1][axis], t[2][axis]});
    if (p[axis] < low - tolerance || p[axis] > high + tolerance) return false;
  }
  return (ClosestPoint(t, n, p) - p).norm() <= tolerance;
}

// The upper surface of MuJoCo's field, in its own frame: two triangles a cell, along the diagonal that
// MuJoCo's prisms have.
struct Grid {
  const mjModel* model;
  int rows, columns, first;
  Vector3 half;  // half sizes along x and y, largest height

  Grid(const mjModel* m, int geom) : model(m) {
    const int id = m->geom_dataid[geom];
    rows = m->hfield_nrow[id];
    columns = m->hfield_ncol[id];
    first = m->hfield_adr[id];
    half = Eigen::Map<const Vector3>(m->hfield_size + 4 * id);
  }
  Vector3 Point(int row, int column) const {
    return {2 * half.x() * column / (columns - 1) - half.x(), 2 * half.y() * row / (rows - 1) - half.y(),
            half.z() * static_cast<double>(model->hfield_data[first + row * columns + column])};
  }
  double Highest(int row, int column) const {
    const float* at = model->hfield_data + first + row * columns + column;
    return half.z() * static_cast<double>(std::max({at[0], at[1], at[columns], at[columns + 1]}));
  }
  Triangle Face(int row, int column, int which) const {
    const Vector3 a = Point(row, column), b = Point(row + 1, column + 1);
    return which == 0 ? Triangle{a, Point(row, column + 1), b} : Triangle{a, b, Point(row + 1, column)};
  }
  // Cells from one coordinate to another.
  static std::pair<int, int> Cells(double from, double to, double half, int points) {
    const double per_m = (points - 1) / (2 * half);
    const auto cell = [&](double x) {
      return static_cast<int>(std::floor(std::clamp((x + half) * per_m, -1.0, double(points))));
    };
    return {std::max(0, cell(from)), std::min(points - 2, cell(to))};
  }
};

constexpr double kNear = 1e-6;  // m
constexpr int kMost = 16;       // contacts, and faces that are told apart at once; MuJoCo has room for 50

// Two faces that have a corner in common, each of which stands above the other's plane: what is under both is
// held by both.
bool MakeValley(const Triangle& a, const Triangle& b) {
  constexpr double kRises = 1e-3;  // rad: less is level but for rounding
  const auto stands_above = [](const Triangle& t, const Triangle& other) {
    const Vector3 way = (t[0] + t[1] + t[2]) / 3 - other[0];
    return Up(other).dot(way) > kRises * way.norm();
  };
  const bool meet = std::any_of(
      a.begin(), a.end(), [&](const Vector3& v) { return std::find(b.begin(), b.end(), v) != b.end(); });
  return meet && stands_above(a, b) && stands_above(b, a);
}

// Keeps the nearest ones, in order.
class NearestFaces {
 public:
  void Add(const Nearest& item) {
    auto at = order_.begin() + count_;
    while (at != order_.begin() && items_[*std::prev(at)].distance > item.distance) --at;
    if (at == order_.end()) return;
    // In the place of the farthest, where all are taken.
    const std::size_t place = count_ < kMost ? static_cast<std::size_t>(count_++) : order_.back();
    std::move_backward(at, order_.begin() + count_ - 1, order_.begin() + count_);
    *at = place;
    items_[place] = item;
  }
  int size() const { return count_; }
  const Nearest& operator[](int i) const { return items_[order_[static_cast<std::size_t>(i)]]; }

 private:
  std::array<Nearest, kMost> items_;
  std::array<std::size_t, kMost> order_;  // places of items, the nearest first
  int count_ = 0;
};

}  // namespace

int SphereOnGrid(const mjModel* model, mjData* data, mjPreContact* contacts, int grid, int sphere,
                 mjtNum margin) {
  return BallOnGrid(model, data, contacts, grid, Eigen::Map<const Vector3>(data->geom_xpos + 3 * sphere),
                    model->geom_size[3 * sphere], margin);
}

int BallOnGrid(const mjModel* model, const mjData* data, mjPreContact* contacts, int geom_of_grid,
               const Vector3& center, double radius, double margin) {
  const Grid grid(model, geom_of_grid);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data->geom_xmat + 9 * geom_of_grid);
  const Eigen::Map<const Vector3> origin(data->geom_xpos + 3 * geom_of_grid);
  const double reach = radius + margin;
  const Vector3 c = R.transpose() * (center - origin);

  // Under the surface only what is right above or below counts.
  const auto [column_from, column_to] =
      Grid::Cells(c.x() - reach, c.x() + reach, grid.half.x(), grid.columns);
  const auto [row_from, row_to] = Grid::Cells(c.y() - reach, c.y() + reach, grid.half.y(), grid.rows);
  NearestFaces above, below;
  Nearest right_above;
  bool is_under = false;
  for (int row = row_from; row <= row_to; ++row)
    for (int column = column_from; column <= column_to; ++column) {
      if (c.z() - grid.Highest(row, column) > reach) continue;
      for (int which : {0, 1}) {
        const Triangle face = grid.Face(row, column, which);
        const Vector3 n = AreaNormal(face);
        // No point of the face is nearer than its plane.
        if (const double along = n.dot(c - face[0]);
            along > 0 && along * along > reach * reach * n.squaredNorm())
          continue;
        const Vector3 up = n.normalized();
        const double height = up.dot(c - face[0]);
        const Vector3 p = ClosestPoint(face, up, c);
        const double distance = (c - p).norm();
        const bool inside = distance <= std::abs(height) * (1 + 1e-9) + 1e-15;
        if (height < 0) {
          Triangle flat = face;
          for (Vector3& v : flat) v.z() = 0;
          const Vector3 c_flat(c.x(), c.y(), 0);
          if ((ClosestPoint(flat, c_flat) - c_flat).norm() <= 1e-12 * grid.half.norm()) {
            is_under = true;
            right_above = {face, up, c - height * up, up, -height};
          }
          if (inside) below.Add({face, up, p, up, distance});
        } else if (distance < reach) {
          above.Add({face, up, p, inside ? up : Vector3((c - p) / distance), distance});
        }
      }
    }

  int count = 0;
  auto report = [&](const Nearest& nearest, double gap) {
    mjPreContact& out = contacts[count++];
    out.dist = gap;
    const Vector3 normal = R * nearest.normal, surface = R * nearest.point + origin;
    Eigen::Map<Vector3>(out.normal) = normal;
    Eigen::Map<Vector3>(out.tangent).setZero();
    Eigen::Map<Vector3>(out.pos) = surface + 0.5 * gap * normal;
  };
  // What is about the bottom of a valley is held by both sides, also where only one is straight above or
  // below.
  auto report_valley = [&](const Nearest& nearest, double height_of_nearest) {
    const Vector3 ground = ClosestPoint(nearest.triangle, nearest.up, nearest.point);
    for (int row = row_from; row <= row_to; ++row)
      for (int column = column_from; column <= column_to; ++column)
        for (int which : {0, 1}) {
          const Triangle face = grid.Face(row, column, which);
          const Vector3 up = Up(face);
          const double height = up.dot(c - face[0]);
          if (count == kMost || !(height < reach) || !MakeValley(face, nearest.triangle)) continue;
          // Faces that have no more than a corner in common: the plane of one may pass over the other, where
          // it is not the ground, and over what is above the ground.
          if (up.dot(ground - face[0]) < -kNear || (!is_under && height < -kNear)) continue;
          const Vector3 foot = c - height * up;
          const double beside = (ClosestPoint(face, foot) - foot).norm();
          if (height < 0 || (beside > 0 && beside <= std::min(height_of_nearest, kNear) + kNear))
            report({face, up, foot, up, 0}, height - radius);
        }
  };
  if (is_under) {
    const Nearest nearest = below.size() > 0 ? below[0] : right_above;  // none: under the bottom of a valley
    report(nearest, -nearest.distance - radius);
    report_valley(nearest, 0);
    return count;
  }
  // Nearest among neighbours: no face that has this point too comes nearer. Of equal ones the first counts.
  const double same = 1e-9 * grid.half.norm();
  for (int i = 0; i < above.size(); ++i) {
    bool is_least = true;
    for (int k = 0; k < i && is_least; ++k)
      is_least = !IsOn(above[k].triangle, above[k].up, above[i].point, same);
    if (is_least) report(above[i], above[i].distance - radius);
  }
  if (radius == 0 && above.size() > 0) report_valley(above[0], above[0].distance);
  return count;
}

bool SupportsFromBelow(const mjModel* model, const mjData* data, int geom_of_grid, const Vector3& point,
                       const Vector3& normal) {
  constexpr double kOn = 1e-6;    // m: MuJoCo keeps heights as floats
  constexpr double kBend = 1e-3;  // rad that a neighbour may rise by: what is level but for rounding
  const Grid grid(model, geom_of_grid);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data->geom_xmat + 9 * geom_of_grid);
  const Vector3 p = R.transpose() * (point - Eigen::Map<const Vector3>(data->geom_xpos + 3 * geom_of_grid));
  const Vector3 n = R.transpose() * normal;
  const auto [column_from, column_to] = Grid::Cells(p.x() - kOn, p.x() + kOn, grid.half.x(), grid.columns);
  const auto [row_from, row_to] = Grid::Cells(p.y() - kOn, p.y() + kOn, grid.half.y(), grid.rows);
  bool on_it = false;
  double least_z =
      1;  // of the normals of the faces here; one that they carry is a positive sum of those, z no smaller
  for (int row = row_from; row <= row_to; ++row)
    for (int column = column_from; column <= column_to; ++column)
      for (int which : {0, 1}) {
        const Triangle face = grid.Face(row, column, which);
        if ((ClosestPoint(face, p) - p).norm() > kOn) continue;
        on_it = true;
        least_z = std::min(least_z, Up(face).z());
        for (const Vector3& corner : face)
          if (n.dot(corner - p) > kBend * (corner - p).norm() + kOn) return false;
      }
  return on_it && n.z() > least_z - kBend;  // else the side of a column
}

EdgesOfGrid EdgesThrough(const mjModel* model, const mjData* data, int geom_of_grid, const Vector3& point) {
  constexpr double kOn = 1e-6;  // m: MuJoCo keeps heights as floats
  const Grid grid(model, geom_of_grid);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data->geom_xmat + 9 * geom_of_grid);
  const Eigen::Map<const Vector3> origin(data->geom_xpos + 3 * geom_of_grid);
  const Vector3 p = R.transpose() * (point - origin);
  const auto [column_from, column_to] = Grid::Cells(p.x() - kOn, p.x() + kOn, grid.half.x(), grid.columns);
  const auto [row_from, row_to] = Grid::Cells(p.y() - kOn, p.y() + kOn, grid.half.y(), grid.rows);
  EdgesOfGrid edges;
  for (int row = row_from; row <= row_to; ++row)
    for (int column = column_from; column <= column_to; ++column)
      for (int which : {0, 1}) {
        const Triangle face = grid.Face(row, column, which);
        for (std::size_t i = 0; i < 3; ++i) {
          const Vector3 &a = face[i], &b = face[(i + 1) % 3];
          if (edges.count == EdgesOfGrid::kMost || (OnSegment(a, b, p) - p).norm() > kOn) continue;
          const auto known = edges.ends.begin() + edges.count;
          // In the field's frame until all are there.
          if (std::none_of(edges.ends.begin(), known, [&](const auto& e) {
                return (e.first == a && e.second == b) || (e.first == b && e.second == a);
              }))
            edges.ends[static_cast<std::size_t>(edges.count++)] = {a, b};
        }
      }
  for (int i = 0; i < edges.count; ++i) {
    auto& [a, b] = edges.ends[static_cast<std::size_t>(i)];
    a = R * a + origin;
    b = R * b + origin;
  }
  return edges;
}

}  // namespace fork1s::internal
