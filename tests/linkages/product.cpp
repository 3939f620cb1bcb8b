#include "product.hpp"

#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/frequencies.hpp>

namespace fork1s::linkages {
namespace {

VectorX Reference(const Written& linkage) { return VectorX::Zero(linkage.mechanism->num_coordinates()); }

}  // namespace

InterfaceCompliance Walk(const Written& linkage) {
  return WalkCompliance(*linkage.mechanism, Reference(linkage), linkage.interfaces);
}

InterfaceCompliance Dense(const Written& linkage) {
  return DenseCompliance(*linkage.mechanism, Reference(linkage), linkage.interfaces);
}

Expected<ReducedModel> ReduceAtReference(const Written& linkage) {
  ReductionOptions options;
  options.interfaces = linkage.interfaces;
  options.modes = 0;
  return Reduce(linkage.mechanism, Reference(linkage), options);
}

std::string JointOf(const Error& error) {
  const std::string prefix = "joint '";
  if (error.code != ErrorCode::kUnderdetermined || error.where.rfind(prefix, 0) != 0) return {};
  return error.where.substr(prefix.size(), error.where.size() - prefix.size() - 1);
}

std::vector<double> AllFrequencies(const Written& linkage) {
  return FullFrequencies(*linkage.mechanism, Reference(linkage), 1000);
}

}  // namespace fork1s::linkages
