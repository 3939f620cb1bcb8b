// Shapes of vibrations, and which of two lists have the same.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <vector>

namespace fork1s {

struct VibrationModes {
  std::vector<double> hertz;  ///< ascending
  MatrixX shapes;             ///< n x their number: displacements of joints, those of no stiffness along
};

/// Of the springs alone at q, the lowest `count`: those of FullFrequencies.
VibrationModes ComputeSpringModes(const Mechanism& mechanism, const VectorX& q, int count = 8);

struct ModePair {
  int mode = -1;  ///< of the second list; -1: none has this shape
  double agreement =
      0;  ///< (aᵀM b)² / (aᵀM a  bᵀM b), the modal assurance criterion; of equal frequencies, with their span
};
/// For each of the first modes the one of the second that has its shape, by the masses at q with the base
/// held. Shapes of one list are orthogonal in M, so that one alone can have more than half of another.
std::vector<ModePair> PairModesByShape(const Mechanism& mechanism, const VectorX& q,
                                       const VibrationModes& first, const VibrationModes& second);

}  // namespace fork1s
