// Answers of the library beside those of the plain method.
#pragma once

#include "plain_method.hpp"
#include "product.hpp"

namespace fork1s::linkages {

/// Two digits above what double precision leaves of a well-posed linkage (plain_road.cpp).
constexpr double kSame = 1e-8;

/// Relative difference of compliances, and distance of the spans of free directions.
struct Compared {
  double difference = 0, free_distance = 0;
};

/// Free directions are projected off with the sketch's size for a length, whatever the library's was: the
/// last projection to act decides, since each leaves only free directions out.
inline Compared CompareWithPlain(const InterfaceCompliance& found, const PlainAnswer& plain, double size) {
  Compared c;
  const MatrixX P = ProjectOff(plain.free_d, size);
  // Where loops hold the interface, what is left is rounding of the springs' own compliance: 1e-12 of it.
  const double floor = plain.interface_rank > 0 ? 0 : 1e-4 * plain.open_compliance * size * size;
  c.difference = RelativeDifference(P * found.C * P.transpose(), plain.C, size, floor);
  c.free_distance = SpanDistance(found.free, plain.free_d, size);
  return c;
}

/// A linkage with all that the methods say of it.
struct Methods {
  explicit Methods(const Sketch& sketch, const Writing& writing = {})
      : linkage(Build(sketch, writing)),
        plain(PlainMethod(*linkage.mechanism, linkage.interfaces, sketch.size)),
        walk(Walk(linkage)),
        dense(Dense(linkage)),
        model(ReduceAtReference(linkage)),
        frequencies(AllFrequencies(linkage)),
        size(sketch.size) {}

  /// Motions that the loops leave.
  int mobility() const { return linkage.mechanism->num_coordinates() - plain.loop_rank; }

  Written linkage;
  PlainAnswer plain;
  InterfaceCompliance walk, dense;
  Expected<ReducedModel> model;
  std::vector<double> frequencies;
  double size;
};

}  // namespace fork1s::linkages
