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

namespace {

// Of AddSixTimesSix fours of rows, then two, then one, side by side: each number of T is looked up once for all.
template <int fours, bool two, bool one>
void AddRowsTimesSix(const double* X, std::ptrdiff_t stride, SixRows T, int columns, double* out,
                     std::ptrdiff_t out_stride) {
  using Two = Eigen::Matrix<double, 2, 1>;
  constexpr int at_two = 4 * fours, at_one = at_two + (two ? 2 : 0);
  const std::ptrdiff_t by_row = T.by_row;
  const double* t = T.t;
  for (int c = 0; c < columns; ++c, t += T.by_column, out += out_stride) {
    Quad four[fours + 1];
    Two pair;
    double single = 0;
    for (int f = 0; f < fours; ++f) four[f] = QuadAt(out + 4 * f);
    if constexpr (two) pair = Eigen::Map<const Two>(out + at_two);
    if constexpr (one) single = out[at_one];
    const double* x = X;
    for (int k = 0; k < 6; ++k, x += stride) {
      const double factor = t[k * by_row];
      for (int f = 0; f < fours; ++f) four[f] += factor * QuadAt(x + 4 * f);
      if constexpr (two) pair += factor * Eigen::Map<const Two>(x + at_two);
      if constexpr (one) single += factor * x[at_one];
    }
    for (int f = 0; f < fours; ++f) QuadAt(out + 4 * f) = four[f];
    if constexpr (two) Eigen::Map<Two>(out + at_two) = pair;
    if constexpr (one) out[at_one] = single;
  }
}

}  // namespace

void AddSixTimesSix(const double* X, int stride, int n, SixRows T, int columns, double* out,
                    std::ptrdiff_t out_stride) {
  for (; n >= 8; n -= 8, X += 8, out += 8)
    AddRowsTimesSix<2, false, false>(X, stride, T, columns, out, out_stride);
  switch (n) {
    case 1:
      return AddRowsTimesSix<0, false, true>(X, stride, T, columns, out, out_stride);
    case 2:
      return AddRowsTimesSix<0, true, false>(X, stride, T, columns, out, out_stride);
    case 3:
      return AddRowsTimesSix<0, true, true>(X, stride, T, columns, out, out_stride);
    case 4:
      return AddRowsTimesSix<1, false, false>(X, stride, T, columns, out, out_stride);
    case 5:
      return AddRowsTimesSix<1, false, true>(X, stride, T, columns, out, out_stride);
    case 6:
      return AddRowsTimesSix<1, true, false>(X, stride, T, columns, out, out_stride);
    case 7:
      return AddRowsTimesSix<1, true, true>(X, stride, T, columns, out, out_stride);
    default:
      return;
  }
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
  // W is symmetric: of its first four columns the last two rows are those of the others.
  Quad low[6], high[2];
  for (Quad& sum : low) sum.setZero();
  for (Quad& sum : high) sum.setZero();
  for (const double* y = by_freedom; y != rows; y += 8) {
    const Quad first = QuadAt(y), last = QuadAt(y + 4);
    for (int c = 0; c < 6; ++c) low[c] += y[c] * first;
    for (int c = 0; c < 2; ++c) high[c] += y[4 + c] * last;
  }
  for (int c = 0; c < 6; ++c) {
    QuadAt(W.data() + 8 * c) = low[c];
    QuadAt(W.data() + 8 * c + 4) = c < 4 ? Quad(low[4][c], low[5][c], 0, 0) : high[c - 4];
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
