#include "product.hpp"

#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/frequencies.hpp>

namespace fork1s::linkages {
namespace {

ComplianceAnswer Answer(const Written& linkage, const Expected<MatrixX>& C) {
  ComplianceAnswer answer;
  answer.exists = C.has_value();
  if (!C) return answer;
  answer.C = *C;
  answer.free = MatrixX(C->rows(), 0);
  answer.rank = ComplianceRank(*C, linkage.mechanism->length_scale());
  return answer;
}

VectorX Reference(const Written& linkage) { return VectorX::Zero(linkage.mechanism->num_coordinates()); }

}  // namespace

ComplianceAnswer Walk(const Written& linkage) {
  return Answer(linkage, WalkCompliance(*linkage.mechanism, Reference(linkage), linkage.interfaces));
}

ComplianceAnswer Dense(const Written& linkage) {
  return Answer(linkage, DenseCompliance(*linkage.mechanism, Reference(linkage), linkage.interfaces));
}

Expected<ReducedModel> ReduceAtReference(const Written& linkage) {
  ReductionOptions options;
  options.interfaces = linkage.interfaces;
  options.modes = 0;
  return Reduce(linkage.mechanism, Reference(linkage), options);
}

bool IsDoubtful(const ReducedModel&) { return false; }

std::string JointOf(const Error& error) {
  const std::string prefix = "joint '";
  if (error.code != ErrorCode::kUnderdetermined || error.where.rfind(prefix, 0) != 0) return {};
  return error.where.substr(prefix.size(), error.where.size() - prefix.size() - 1);
}

std::vector<double> AllFrequencies(const Written& linkage) {
  return FullFrequencies(*linkage.mechanism, Reference(linkage), 1000);
}

}  // namespace fork1s::linkages
