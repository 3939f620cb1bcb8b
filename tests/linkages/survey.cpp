#include "survey.hpp"

#include <algorithm>

#include "compare.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

// How much the coordinates of a joint move in the hidden motions, relative to the one that moves most.
double ShareOf(const Mechanism& m, const MatrixX& motions, const std::string& joint_name) {
  if (motions.cols() == 0) return 0;
  const VectorX moved = motions.rowwise().norm();
  for (const Mechanism::Joint& j : m.joints())
    if (j.name == joint_name) return moved.segment(j.offset, j.size).maxCoeff() / moved.maxCoeff();
  return 0;
}

Sample Take(unsigned seed) {
  const Sketch sketch = RandomLinkage(seed);
  const Written linkage = Build(sketch, {.seed = seed});
  const Mechanism& m = *linkage.mechanism;
  const PlainAnswer plain = PlainMethod(m, linkage.interfaces, sketch.size);

  Sample s;
  s.seed = seed;
  s.family = sketch.family;
  s.well_posed = plain.well_posed;
  s.expected_error = plain.expected_error;
  s.smallest_kept = plain.smallest_kept;
  s.largest_dropped = plain.largest_dropped;
  s.coordinates = m.num_coordinates();
  s.loop_rank = plain.loop_rank;
  s.free = plain.free;
  s.elastic = plain.elastic;
  s.interface_free = plain.interface_free;
  s.interface_rank = plain.interface_rank;
  s.springs =
      static_cast<int>((m.stiffness().array() > 0).count() + static_cast<Eigen::Index>(m.springs().size()));
  s.has_loops = m.num_constraints() > 0;
  s.overconstrained = plain.loop_rank < m.num_constraints();

  const InterfaceCompliance walk = Walk(linkage), dense = Dense(linkage);
  const Compared w = CompareWithPlain(walk, plain, sketch.size),
                 d = CompareWithPlain(dense, plain, sketch.size);
  s.walk = w.difference;
  s.dense = d.difference;
  s.walk_free = w.free_distance;
  s.dense_free = d.free_distance;
  s.walk_rank = walk.rank;
  s.dense_rank = dense.rank;
  s.to_each_other = ComplianceDifference(walk, dense, sketch.size);
  for (const auto* doubts : {&walk.doubts, &dense.doubts})
    for (const RankDoubt& doubt : *doubts) s.doubts += doubt.Text() + "; ";

  const auto model = ReduceAtReference(linkage);
  s.refused = !model.has_value();
  if (model) {
    s.model_loop_rank = model->loop_rank();
    s.model_free = model->num_free;
    s.model_elastic = model->num_elastic;
    for (const RankDoubt& doubt : model->doubts) s.doubts += doubt.Text() + "; ";
  } else {
    s.refusal = model.error().Text();
    s.named_share = ShareOf(m, plain.hidden_q, JointOf(model.error()));
  }
  s.frequencies = static_cast<int>(AllFrequencies(linkage).size());
  return s;
}

}  // namespace

const std::vector<Sample>& TheSurvey() {
  static const std::vector<Sample> samples = [] {
    std::vector<Sample> taken;
    for (unsigned seed = 0; seed < kSurveyed; ++seed) taken.push_back(Take(seed));
    return taken;
  }();
  return samples;
}

}  // namespace fork1s::linkages
