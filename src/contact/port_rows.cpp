#include "port_rows.hpp"

#include <fork1s/base/quad.hpp>

namespace fork1s::internal {
namespace {

// Yᵀ x, Y of n rows and six columns.
Vector6 SixDots(const double* Y, int stride, const double* x, int n) {
  const double *y0 = Y, *y1 = y0 + stride, *y2 = y1 + stride, *y3 = y2 + stride, *y4 = y3 + stride,
               *y5 = y4 + stride;
  Quad s0 = Quad::Zero(), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0;
  ByFours(n, [&](const auto& at) {
    using Some = typename decltype(at(x))::PlainObject;
    constexpr int kSize = Some::RowsAtCompileTime;
    const Some some = at(x);
    s0.head<kSize>() += at(y0).cwiseProduct(some);
    s1.head<kSize>() += at(y1).cwiseProduct(some);
    s2.head<kSize>() += at(y2).cwiseProduct(some);
    s3.head<kSize>() += at(y3).cwiseProduct(some);
    s4.head<kSize>() += at(y4).cwiseProduct(some);
    s5.head<kSize>() += at(y5).cwiseProduct(some);
  });
  Vector6 sums;
  sums << s0.sum(), s1.sum(), s2.sum(), s3.sum(), s4.sum(), s5.sum();
  return sums;
}

}  // namespace

void AddSixColumns(const double* X, int stride, const double* t, int n, double* out) {
  const double *x0 = X, *x1 = x0 + stride, *x2 = x1 + stride, *x3 = x2 + stride, *x4 = x3 + stride,
               *x5 = x4 + stride;
  const double t0 = t[0], t1 = t[1], t2 = t[2], t3 = t[3], t4 = t[4], t5 = t[5];
  ByFours(n, [&](const auto& at) {
    using Some = typename decltype(at(out))::PlainObject;
    Some sum = at(out) + t0 * at(x0);
    sum += t1 * at(x1);
    sum += t2 * at(x2);
    sum += t3 * at(x3);
    sum += t4 * at(x4);
    sum += t5 * at(x5);
    at(out) = sum;
  });
}

void AddSixTimesSix(const double* X, int stride, int n, SixRows T, int columns, double* out,
                    std::ptrdiff_t out_stride) {
  const std::ptrdiff_t by_row = T.by_row, by_column = T.by_column;
  const double *x0 = X, *x1 = x0 + stride, *x2 = x1 + stride, *x3 = x2 + stride, *x4 = x3 + stride,
               *x5 = x4 + stride;
  ByFours(n, [&](const auto& at) {
    using Some = typename decltype(at(out))::PlainObject;
    const Some s0 = at(x0), s1 = at(x1), s2 = at(x2), s3 = at(x3), s4 = at(x4), s5 = at(x5);
    const double* t = T.t;
    double* to = out;
    for (int c = 0; c < columns; ++c, t += by_column, to += out_stride) {
      Some sum = at(to) + t[0] * s0;
      sum += t[by_row] * s1;
      sum += t[2 * by_row] * s2;
      sum += t[3 * by_row] * s3;
      sum += t[4 * by_row] * s4;
      sum += t[5 * by_row] * s5;
      at(to) = sum;
    }
  });
}

void PortRows::SetChange(const double* d) {
  change = SixDots(Y, stride, d + begin, freedoms);
  if (freedoms_apart > 0) change += SixDots(Y_apart, stride, d + begin_apart, freedoms_apart);
}

void PortRows::AddTo(const Vector6& wrench, double* sum) const {
  AddSixColumns(Y, stride, wrench.data(), freedoms, sum + begin);
  if (freedoms_apart > 0) AddSixColumns(Y_apart, stride, wrench.data(), freedoms_apart, sum + begin_apart);
}

void PortRows::SetW() {
  for (int c = 0; c < 6; ++c) {
    const auto at = static_cast<std::ptrdiff_t>(c) * stride;
    W.col(c) = SixDots(Y, stride, Y + at, freedoms);
    if (freedoms_apart > 0) W.col(c) += SixDots(Y_apart, stride, Y_apart + at, freedoms_apart);
  }
}

void PortRows::AddFourTo(const double* T, double* sum) const {
  const Quad t0 = QuadAt(T), t1 = QuadAt(T + 4), t2 = QuadAt(T + 8), t3 = QuadAt(T + 12), t4 = QuadAt(T + 16),
             t5 = QuadAt(T + 20);
  const auto add = [&](const double* y, int first, int count) {
    const double *y1 = y + stride, *y2 = y1 + stride, *y3 = y2 + stride, *y4 = y3 + stride, *y5 = y4 + stride;
    double* to = sum + 4 * first;
    for (int i = 0; i < count; ++i, to += 4) {
      Quad some = QuadAt(to) + y[i] * t0;
      some += y1[i] * t1;
      some += y2[i] * t2;
      some += y3[i] * t3;
      some += y4[i] * t4;
      some += y5[i] * t5;
      QuadAt(to) = some;
    }
  };
  add(Y, begin, freedoms);
  if (freedoms_apart > 0) add(Y_apart, begin_apart, freedoms_apart);
}

void PortRows::FourChanges(const double* d, double* out) const {
  Quad s0 = Quad::Zero(), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0;
  const auto add = [&](const double* y, int first, int count) {
    const double *y1 = y + stride, *y2 = y1 + stride, *y3 = y2 + stride, *y4 = y3 + stride, *y5 = y4 + stride;
    const double* from = d + 4 * first;
    for (int i = 0; i < count; ++i, from += 4) {
      const Quad some = QuadAt(from);
      s0 += y[i] * some;
      s1 += y1[i] * some;
      s2 += y2[i] * some;
      s3 += y3[i] * some;
      s4 += y4[i] * some;
      s5 += y5[i] * some;
    }
  };
  add(Y, begin, freedoms);
  if (freedoms_apart > 0) add(Y_apart, begin_apart, freedoms_apart);
  QuadAt(out) = s0;
  QuadAt(out + 4) = s1;
  QuadAt(out + 8) = s2;
  QuadAt(out + 12) = s3;
  QuadAt(out + 16) = s4;
  QuadAt(out + 20) = s5;
}

}  // namespace fork1s::internal
