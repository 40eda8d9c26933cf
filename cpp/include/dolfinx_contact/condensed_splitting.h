// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_splitting.h
/// Alternating directions: the factors of one matrix serve hundreds of iterations, and need no rank
/// of W. A start for Newton's method.
#pragma once

#include "condensed_blocks.h"
#include "condensed_newton.h"
#include <algorithm>

namespace dolfinx_contact::condensed {
/// x of (W + rho I) x = rho (z - u) - q - rho |u_t| e_n, which is the law's equation with -rho u
/// for the displacement; z = proj(x + u, C); u grows by x - z. Over-relaxed, with rho so that both
/// are left alike [S. Boyd, N. Parikh, E. Chu, B. Peleato, J. Eckstein, Found. Trends Mach. Learn.
/// 3 (2011), Section 3.4]. There are no tied rows.
template <int T> class Splitting {
  public:
    static constexpr int D = T + 1;

    Splitting(const System<T> &system, double rho)
        : system_(system), blocks_(system), q_(system.left.cwiseProduct(system.q)),
          z_(VectorXd::Zero(system.size())), u_(z_), rho_(rho) {}

    /// More iterations from where the last ones ended, until x and z differ by less than `target`
    /// of them and do not change.
    void run(double target, int iterations, Budget &budget) {
        constexpr int often = 50, adapted = 1000;
        constexpr double relaxation = 1.6;
        for (int k = 0; k < iterations && !budget.spent(); ++k, ++budget.iterations) {
            if (stale_ && !factor())
                return;
            const VectorXd x = blocks_.solve(right_hand_side()), before = z_;
            if (!x.allFinite())
                return;
            const VectorXd relaxed = relaxation * x + (1.0 - relaxation) * z_;
            z_ = projected(relaxed + u_);
            u_ += relaxed - z_;
            const double size = std::max(x.norm(), z_.norm()), apart = (x - z_).norm(),
                         change = (z_ - before).norm();
            if (apart <= target * size && change <= target * size)
                break;
            if (++count_ % often == 0 && count_ <= adapted)
                balance(apart / size, change / u_.norm());
        }
        budget.tell(system_, z_);
    }
    const VectorXd &reactions() const { return z_; }
    double fill() const { return blocks_.fill(); }

  private:
    VectorXd right_hand_side() const {
        VectorXd rhs = rho_ * (z_ - u_) - q_;
        for (Index i = 0; i < system_.nodes; ++i)
            if (!smooth(i))
                rhs[D * i + T] -= rho_ * u_.template segment<T>(D * i).norm();
        return rhs;
    }
    bool factor() {
        using Blocks = typename BlockSolver<T>::Blocks;
        const typename BlockSolver<T>::Block block = rho_ * BlockSolver<T>::Block::Identity();
        stale_ = false;
        return blocks_.factor(Blocks(static_cast<std::size_t>(system_.nodes), block));
    }
    /// Another rho where one of the two is left far more than the other.
    void balance(double apart, double change) {
        constexpr double uneven = 3.0, most = 5.0;
        const double ratio = std::sqrt(apart / change);
        if (!std::isfinite(ratio) || (ratio < uneven && ratio > 1.0 / uneven))
            return;
        const double times = std::clamp(ratio, 1.0 / most, most);
        rho_ *= times;
        u_ /= times;
        stale_ = true;
    }
    /// On the cone; of a contact without friction on its axis.
    VectorXd projected(VectorXd x) const {
        for (Index i = 0; i < system_.nodes; ++i) {
            auto tangential = x.template segment<T>(D * i);
            double &normal = x[D * i + T];
            const double t = smooth(i) ? 0.0 : tangential.norm();
            if (smooth(i))
                tangential.setZero();
            if (t <= normal)
                continue;
            const double on_cone = std::max(0.5 * (normal + t), 0.0);
            tangential *= t > 0.0 ? on_cone / t : 0.0;
            normal = t > 0.0 ? on_cone : 0.0;
        }
        return x;
    }
    bool smooth(Index i) const { return system_.smooth[static_cast<std::size_t>(i)]; }

    const System<T> &system_;
    BlockSolver<T> blocks_;
    VectorXd q_, z_, u_;
    double rho_;
    int count_ = 0;
    bool stale_ = true; // the factors are of another rho
};
} // namespace dolfinx_contact::condensed
