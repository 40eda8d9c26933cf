// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_fixed_point.h
/// Return map and prefactored body in turn (Douglas-Rachford splitting), accelerated by Anderson's
/// method: slow at the end, but it finds its way from far off. A start for Newton's method.
#pragma once

#include "condensed_newton.h"

namespace dolfinx_contact::condensed {
/// Anderson's method, type II [H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49 (2011), Section 2].
class Anderson {
  public:
    explicit Anderson(std::size_t depth) : depth_(depth) {}

    /// The iterate after x, whose correction is g.
    VectorXd step(const VectorXd &x, const VectorXd &g) {
        if (last_x_.size() > 0) {
            dx_.emplace_back(x - last_x_);
            dg_.emplace_back(g - last_g_);
            if (dx_.size() > depth_) {
                dx_.pop_front();
                dg_.pop_front();
            }
        }
        last_x_ = x;
        last_g_ = g;
        VectorXd next = x + g;
        if (!dg_.empty()) {
            MatrixXd differences(g.size(), static_cast<Index>(dg_.size()));
            for (std::size_t k = 0; k < dg_.size(); ++k)
                differences.col(static_cast<Index>(k)) = dg_[k];
            const VectorXd gamma = differences.colPivHouseholderQr().solve(g);
            for (std::size_t k = 0; k < dg_.size(); ++k)
                next -= gamma[static_cast<Index>(k)] * (dx_[k] + dg_[k]);
        }
        return next;
    }

  private:
    std::size_t depth_;
    VectorXd last_x_, last_g_;
    std::deque<VectorXd> dx_, dg_;
};

/// Iterates z = r - rho w: the law returns r(z), the body answers r'(2 r(z) - z) with
/// w' = q + W r', r' + rho w' = 2 r(z) - z, and z moves by r' - r. At the end r is that of the
/// smallest correction. Returns early once the correction is below `target`.
template <int T>
void fixed_point(const System<T> &system, VectorXd &r, double target, int max_iterations,
                 Budget &budget) {
    constexpr int D = T + 1;
    VectorXd rho = VectorXd::Ones(system.size());
    for (Index i = 0; i < system.nodes; ++i) {
        rho.segment<D>(D * i).setConstant(system.rho_t[i]);
        rho[D * i + T] = system.rho_n[i];
    }
    MatrixXd A = system.W->dense();
    A.array() *= (system.left * system.right.transpose()).array();
    A.diagonal() += rho.cwiseInverse();
    const Eigen::PartialPivLU<Eigen::Ref<MatrixXd>> body(A); // in place
    const VectorXd free = system.left.cwiseProduct(system.q), zero = VectorXd::Zero(system.size());

    VectorXd z = r - rho.cwiseProduct(system.displacement(r));
    Anderson anderson(12);
    State<T> state;
    double smallest = std::numeric_limits<double>::infinity();
    for (int k = 0; k < max_iterations && !budget.spent(); ++k, ++budget.iterations) {
        state.evaluate(system, z, zero); // with w = 0 the map takes tau = z
        const VectorXd law = state.mapped();
        const VectorXd g = body.solve((2.0 * law - z).cwiseQuotient(rho) - free) - law;
        const double norm = g.norm();
        if (!std::isfinite(norm))
            return;
        if (norm < smallest) {
            smallest = norm;
            r = law;
        }
        if (norm <= target * std::max(1.0, law.norm()))
            return;
        if (norm > 1e3 * smallest)
            anderson = Anderson(12);
        z = anderson.step(z, g);
    }
}
} // namespace dolfinx_contact::condensed
