// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_feasibility.h
/// Contacts that close whatever the reactions are, as those of a body between two planes that come
/// together: there is no solution then, which normal forces prove.
#pragma once

#include "condensed_interior.h"

namespace dolfinx_contact::condensed {
/// Normal forces y >= 0 that move no contact, W y = 0, while contacts close against them, q y < 0:
/// gaps w_n have y w_n = q y < 0 for all reactions [J. Farkas, J. Reine Angew. Math. 124 (1902)].
/// They are sought as the last difference of proximal points of the problem without friction, which
/// tends to such forces where that has no solution [G. Banjac, P. Goulart, B. Stellato, S. Boyd, J.
/// Optim. Theory Appl. 183 (2019)]; the interior point method finds the first of them. Of each
/// contact; empty if nothing closes or a point is not found. What is returned is no proof before
/// `Judge::excludes` says so. There are no tied rows.
inline VectorXd closing_forces(const Operator &op, const VectorXd &q_n, Budget &budget) {
    constexpr double part = 1e-5, accuracy = 1e-12;
    constexpr int points = 10, newton_iterations = 100;
    const double length = q_n.size() > 0 ? -q_n.minCoeff() : 0.0, compliance = op.mean_normal();
    if (!(length > 0.0 && compliance > 0.0))
        return {};
    System<0> system;
    system.nodes = op.nodes();
    system.tied = 0;
    system.W = &op.normal();
    system.inverse = nullptr;
    system.pattern = op.pattern();
    system.left = VectorXd::Constant(q_n.size(), 1.0 / length);
    system.right = VectorXd::Constant(q_n.size(), length / compliance);
    system.smooth.assign(static_cast<std::size_t>(q_n.size()), true);
    system.set_metric();
    system.shift = part * compliance;
    VectorXd last = VectorXd::Zero(q_n.size()), found = last;
    for (int k = 0; k < points; ++k) {
        last = found;
        system.q = q_n - system.shifted(system.right.cwiseProduct(last));
        VectorXd r = k == 0 ? InteriorPoint<0>(system).run(budget) : last;
        const auto keep = [&](const VectorXd &mapped) {
            found = mapped;
            return true;
        };
        if (Newton<0>(system).solve(r, accuracy, budget, newton_iterations, keep) != End::converged)
            return {};
    }
    return (found - last).cwiseMax(0.0);
}
} // namespace dolfinx_contact::condensed
