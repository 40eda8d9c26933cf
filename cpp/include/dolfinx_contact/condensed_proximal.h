// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_proximal.h
/// Proximal point method [R. T. Rockafellar, SIAM J. Control Optim. 14 (1976)]: problems with
/// W + alpha I, which is regular, and alpha (r - last r) instead of alpha r, which vanishes.
#pragma once

#include "condensed_sweeps.h"

namespace dolfinx_contact::condensed {
/// Moves r by problems w = q + W r + alpha (r - last r), until accepted(r), the error of a
/// solution of one of them, is zero. Each is solved by Newton's method; where that fails, sweeps
/// take it further and alpha, in units of the mean normal compliance, grows; else it falls. Ends
/// when `patience` of them in turn have not halved the error.
template <int T, class Error>
bool proximal(System<T> system, VectorXd &r, double compliance, int patience, Budget &budget,
              Error error) {
    constexpr double first = 0.1, smallest = 1e-10, largest = 1e3, fastest = 0.2, up = 5.0;
    constexpr int sweeps = 30, newton_iterations = 30;
    const VectorXd q = system.q;
    double alpha = first, down = fastest, least = std::numeric_limits<double>::infinity();
    for (int k = 0, in_vain = 0; in_vain < patience && !budget.spent(); ++k, ++in_vain) {
        system.shift = alpha * compliance;
        system.q = q - system.shifted(system.right.cwiseProduct(r));
        VectorXd trial = r, mapped;
        const auto keep = [&](const VectorXd &found) {
            mapped = found;
            return true;
        };
        const bool solved =
            Newton<T>(system).solve(trial, 1e-9, budget, newton_iterations, keep) == End::converged;
        if (solved) {
            r = mapped;
            alpha = std::max(smallest, alpha * down);
            down = std::max(fastest, down * down);
        } else {
            Sweeps<T>(system).run(r, 1e-9, sweeps, budget);
            alpha = std::min(largest, alpha * up);
            down = std::sqrt(down);
        }
        const double found = error(r);
        if (found == 0.0)
            return true;
        if (found < 0.5 * least) {
            least = found;
            in_vain = 0;
        }
    }
    return false;
}
} // namespace dolfinx_contact::condensed
