// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_plane.h
/// Contacts in two dimensions are a linear complementarity problem: Lemke's method, and for a few
/// contacts all states there are, which decides.
#pragma once

#include "condensed_system.h"
#include <functional>

namespace dolfinx_contact::condensed {
using MatrixXl = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

/// z >= 0, M z + q >= 0, orthogonal, by C. E. Lemke's complementary pivots [Manage. Sci. 11 (1965)]
/// from the covering vector d > 0; empty if they end in a ray. `heed` is called for each pivot.
inline VectorXl lemke(const MatrixXl &M, const VectorXl &q, const VectorXl &d, int max_pivots,
                      const std::function<void()> &heed) {
    const Index m = q.size(), covering = 2 * m, right = 2 * m + 1;
    MatrixXl tableau(m, 2 * m + 2); // w - M z - d z0 = q
    tableau << MatrixXl::Identity(m, m), -M, -d, q;
    std::vector<Index> basis(static_cast<std::size_t>(m));
    Index row = 0, entering = covering;
    for (Index i = 0; i < m; ++i) {
        basis[static_cast<std::size_t>(i)] = i;
        if (q[i] / d[i] < q[row] / d[row])
            row = i;
    }
    for (int pivot = 0; q.minCoeff() < 0.0L; ++pivot) {
        if (heed)
            heed();
        const Index leaving = basis[static_cast<std::size_t>(row)];
        tableau.row(row) /= Real(tableau(row, entering));
        for (Index i = 0; i < m; ++i)
            if (i != row && tableau(i, entering) != 0.0L)
                tableau.row(i) -= Real(tableau(i, entering)) * tableau.row(row);
        basis[static_cast<std::size_t>(row)] = entering;
        if (leaving == covering)
            break;
        entering = leaving < m ? leaving + m : leaving - m;
        // the smallest ratio; of equal ones z0, else the largest pivot
        const Real small = 1e-14L * tableau.col(entering).cwiseAbs().maxCoeff();
        Real least = std::numeric_limits<Real>::infinity(), largest = 0.0L;
        row = -1;
        for (Index i = 0; i < m; ++i) {
            const Real a = tableau(i, entering);
            if (!(a > small))
                continue;
            const Real ratio = std::max(tableau(i, right), 0.0L) / a;
            const bool ends = basis[static_cast<std::size_t>(i)] == covering;
            const Real weight = ends ? std::numeric_limits<Real>::infinity() : a;
            if (ratio < least * (1.0L - 1e-15L) || (ratio <= least && weight > largest)) {
                least = ratio;
                largest = weight;
                row = i;
            }
        }
        if (row < 0 || pivot == max_pivots)
            return {};
    }
    VectorXl z = VectorXl::Zero(m);
    for (Index i = 0; i < m; ++i)
        if (const Index k = basis[static_cast<std::size_t>(i)]; k >= m && k < covering)
            z[k - m] = tableau(i, right);
    return z;
}

/// The contacts of a scaled System in two dimensions.
class Plane {
  public:
    explicit Plane(const System<1> &system) : n_(system.nodes), smooth_(system.smooth) {
        const auto left = system.left.cast<Real>(), right = system.right.cast<Real>();
        A_ = left.asDiagonal() * system.W->dense().cast<Real>() * right.asDiagonal();
        q_ = left.cwiseProduct(system.q.cast<Real>());
    }

    /// Reactions by Lemke's method, empty in a ray. With b = r_t + r_n, c = r_n - r_t, w_t = p - m:
    /// z = (r_n, b, m), complements (w_n, p, c).
    VectorXd pivots(const VectorXl &cover, const std::function<void()> &heed) const {
        MatrixXl M = MatrixXl::Zero(3 * n_, 3 * n_);
        VectorXl q = VectorXl::Zero(3 * n_);
        for (Index i = 0; i < n_; ++i) {
            for (Index j = 0; j < n_; ++j) {
                const Real mu = bound(j), tt = A_(2 * i, 2 * j), tn = A_(2 * i, 2 * j + 1),
                           nt = A_(2 * i + 1, 2 * j), nn = A_(2 * i + 1, 2 * j + 1);
                M(i, j) = nn - mu * nt;
                M(i, n_ + j) = nt;
                M(n_ + i, j) = tn - mu * tt;
                M(n_ + i, n_ + j) = tt;
            }
            M(n_ + i, 2 * n_ + i) = 1.0L;
            M(2 * n_ + i, i) = 2.0L * bound(i);
            M(2 * n_ + i, n_ + i) = -1.0L;
            q[i] = q_[2 * i + 1];
            q[n_ + i] = q_[2 * i];
        }
        const VectorXl z = lemke(M, q, cover, 50 * static_cast<int>(n_) + 50, heed);
        if (z.size() == 0)
            return {};
        VectorXd r(2 * n_);
        for (Index i = 0; i < n_; ++i) {
            r[2 * i] = static_cast<double>(z[n_ + i] - bound(i) * z[i]);
            r[2 * i + 1] = static_cast<double>(z[i]);
        }
        return r;
    }

    /// Tries every state of every contact, open, sticking, slipping either way, until accept(r).
    /// True if that, or rounding, leaves the question open; false if no state is a solution.
    template <class Accept> bool all_states(Accept accept) const {
        bool open = false;
        Index count = 1;
        for (Index i = 0; i < n_; ++i)
            count *= 4;
        for (Index state = 0; state < count; ++state) {
            const VectorXl r = solve_state(state);
            if (r.size() == 0)
                open = true; // singular: there may be solutions or none
            else if (plausible(r)) {
                open = true;
                if (accept(VectorXd(r.cast<double>())))
                    return true;
            }
        }
        return open;
    }

  private:
    Real bound(Index i) const { return smooth_[static_cast<std::size_t>(i)] ? 0.0L : 1.0L; }

    /// Reactions of a state, two bits a contact; empty if they are not determined.
    VectorXl solve_state(Index state) const {
        constexpr Real smallest_rcond = 1e-13L;
        MatrixXl to(2 * n_, 0), from(2 * n_, 0);
        const auto add = [&](const VectorXl &test, const VectorXl &trial) {
            to.conservativeResize(Eigen::NoChange, to.cols() + 1);
            from.conservativeResize(Eigen::NoChange, from.cols() + 1);
            to.rightCols(1) = test;
            from.rightCols(1) = trial;
        };
        for (Index i = 0; i < n_; ++i) {
            const Index kind = (state >> (2 * i)) & 3;
            const VectorXl t = VectorXl::Unit(2 * n_, 2 * i), n = VectorXl::Unit(2 * n_, 2 * i + 1);
            if (kind == 1) {
                add(t, t);
                add(n, n);
            } else if (kind > 1)
                add(n, n + (kind == 2 ? bound(i) : -bound(i)) * t);
        }
        if (to.cols() == 0)
            return VectorXl::Zero(2 * n_);
        const Eigen::PartialPivLU<MatrixXl> lu(MatrixXl(to.transpose() * A_ * from));
        if (!(lu.rcond() > smallest_rcond))
            return {};
        return from * lu.solve(VectorXl(-to.transpose() * q_));
    }

    /// Whether the inequalities hold, but for rounding.
    bool plausible(const VectorXl &r) const {
        const VectorXl w = q_ + A_ * r;
        const Real forces = 1e-10L * r.lpNorm<Eigen::Infinity>();
        const Real lengths = 1e-10L * (q_.cwiseAbs() + A_.cwiseAbs() * r.cwiseAbs()).maxCoeff();
        for (Index i = 0; i < n_; ++i) {
            const Real t = r[2 * i], n = r[2 * i + 1], slip = w[2 * i];
            if (n < -forces || w[2 * i + 1] < -lengths || std::abs(t) > bound(i) * n + forces)
                return false;
            if (bound(i) > 0.0L && n > forces && t * slip > 0.0L && std::abs(t) > forces &&
                std::abs(slip) > lengths)
                return false;
        }
        return true;
    }

    Index n_;
    std::vector<bool> smooth_;
    MatrixXl A_;
    VectorXl q_;
};
} // namespace dolfinx_contact::condensed
