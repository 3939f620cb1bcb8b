// Which of many fixed-interface modes matter to the interface bodies.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

#include "elastic_basis.hpp"

namespace fork1s::internal {

/// `all` holds N, V Y_r and every candidate mode in Q, with M, M_0z and D. J [6E x n]: Jacobian of the
/// interface bodies in joint coordinates, rotation rows times `length`. Returns of each candidate the score
/// [m], the displacement of the interface that would be missed without it.
///
/// A mode left out takes w_i = s² m_i + s c_i away from what the coordinates B = [base, N, V Y_r] feel (m_i
/// and c_i its coupling to them by mass and damping). A load f_B on them and f_i on the mode itself then
/// moves the interface wrongly by, to first order,
///
///     score_i = max_s |J_B A_B(s)⁻¹ w_i(s)| |f_i - w_iᵀ A_B⁻¹ f_B| / |1 + s d_i + s² µ_i|,
///     A_B = K_B + s D_B + s² M_B.
///
/// Loads are the weight of the whole on the interface, in every direction, and gravity on all bodies, or the
/// same as an acceleration of the base; each norm goes over all of them.
///
/// s runs along s(ω) = (1 - exp(-iωh))/h, what implicit Euler with h = 1/60 s makes of iω, so that what such
/// a step damps away does not count. docs/method.md, section 4.
VectorX ModeContributions(const ReducedModel& all, const MatrixX& J, double length);

/// At most `count` numbers of the candidates of largest score, counted from 0, in increasing order.
std::vector<int> ContributingModes(const ReducedModel& all, const MatrixX& J, double length, int count);

/// As ReductionOptions::step says. `Y_r` (e x r, orthonormal): the directions that the interface feels.
ModeSelection SelectModesByStep(const Mechanism& mechanism, const Kinematics& kinematics,
                                const ElasticBasis& basis, const MatrixX& Y_r, double step);

}  // namespace fork1s::internal
