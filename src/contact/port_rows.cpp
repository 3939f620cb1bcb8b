#include "port_rows.hpp"

#include <fork1s/base/quad.hpp>

namespace fork1s::internal {
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
  Quad low = Quad::Zero(), high = low;
  const double* y = by_freedom;
  const auto add = [&](const double* x, int count) {
    for (int i = 0; i < count; ++i, y += 8) {
      low += x[i] * QuadAt(y);
      high += x[i] * QuadAt(y + 4);
    }
  };
  add(d + begin, freedoms);
  add(d + begin_apart, freedoms_apart);
  QuadAt(change.data()) = low;
  QuadAt(change.data() + 4) = high;
}

void PortRows::AddTo(const Padded6& wrench, double* sum) const {
  AddSixColumns(Y, stride, wrench.data(), freedoms, sum + begin);
  if (freedoms_apart > 0) AddSixColumns(Y_apart, stride, wrench.data(), freedoms_apart, sum + begin_apart);
}

void PortRows::SetByFreedom(double* rows) {
  by_freedom = rows;
  const auto copy = [&](const double* y, int count) {
    for (int i = 0; i < count; ++i, rows += 8) {
      for (std::ptrdiff_t c = 0; c < 6; ++c) rows[c] = y[c * stride + i];
      rows[6] = rows[7] = 0;
    }
  };
  copy(Y, freedoms);
  copy(Y_apart, freedoms_apart);
  for (int c = 0; c < 6; ++c) {
    Quad low = Quad::Zero(), high = low;
    for (const double* y = by_freedom; y != rows; y += 8) {
      low += y[c] * QuadAt(y);
      high += y[c] * QuadAt(y + 4);
    }
    QuadAt(W.data() + 8 * c) = low;
    QuadAt(W.data() + 8 * c + 4) = high;
    W_diagonal[c] = W(c, c);
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
