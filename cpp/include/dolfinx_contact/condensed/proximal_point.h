// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file proximal_point.h
/// Proximal point method [R. T. Rockafellar, SIAM J. Control Optim. 14 (1976)]: problems with
/// W + alpha I, which is regular, and alpha (r - last r) instead of alpha r, which vanishes.
#pragma once

#include "newton.h"

namespace dolfinx_contact::condensed {
/// Moves r by problems w = q + W r + alpha own (r - last r), `own` a contact's compliance, each
/// solved by Newton's method, until the judge accepts r: error(r), that of the problem itself, then
/// returns zero. Where Newton's method fails alpha grows, else it falls, by a factor `down` that
/// failures bring near one and successes back. Ends when so many of them in turn have not halved
/// the error.
template <int T, class Error>
bool proximal_point(System<T> system, VectorXd &r, Budget &budget, Error error) {
    const VectorXd q = system.q;
    double alpha = Tuning::first_alpha, down = Tuning::alpha_down,
           least = std::numeric_limits<double>::infinity();
    for (int in_vain = 0; in_vain < Tuning::proximal_patience && !budget.spent(); ++in_vain) {
        system.shift = alpha;
        system.q = q - system.shifted(system.right.cwiseProduct(r));
        VectorXd trial = r, mapped;
        const auto keep = [&](const VectorXd &found) {
            mapped = found;
            return true;
        };
        if (Newton<T>(system).solve(trial, Tuning::proximal_target, budget, Tuning::proximal_newton,
                                    keep)) {
            r = mapped;
            alpha = std::max(Tuning::smallest_alpha, alpha * down);
            down = std::max(Tuning::alpha_down, down * down);
        } else {
            alpha = std::min(Tuning::largest_alpha, alpha * Tuning::alpha_up);
            down = std::sqrt(down);
        }
        const double found = error(r);
        if (found == 0.0)
            return true;
        if (found < Tuning::proximal_progress * least) {
            least = found;
            in_vain = 0;
        }
    }
    return false;
}
} // namespace dolfinx_contact::condensed
