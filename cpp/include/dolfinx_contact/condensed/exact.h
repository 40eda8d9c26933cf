// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file exact.h
/// The law of a contact in extended precision, for the judge: what it measures is to be the error
/// of the reactions, not of the measurement. Predictor and slip rule are those of the law's
/// headers; the projection is written apart from the one that solvers use.
#pragma once

#include "../algebra/square.h"
#include "../law/bipotential.h"
#include "../law/slip_rule.h"

namespace dolfinx_contact::condensed {
/// A contact's reaction r and motion w (T tangential components, then the normal one), and what the
/// law finds wrong with them.
template <int T> struct ExactState {
    Eigen::Matrix<Real, T, 1> slip; ///< what of w_t the slip rule does not explain; length
    Eigen::Matrix<Real, T + 1, 1> r, w;
    Eigen::Matrix<Real, T + 1, 1>
        defect; ///< r - proj(r - kappa (Q^2 w_t, w_n + |M Q^2 w_t|)); force
    Branch branch;
};

/// s >= 0 with |e| = 1, e_i = mu_i tau_i / d_i, d_i = (1 + mu_i^2) (s + max(tau_n, 0)) - tau_n: the
/// boundary point of the Euclidean projection, as in friction_cone.h. Newton's method on
/// |e|^-1 = 1, increasing and concave in s, increases towards the root from the left of it.
template <class Law, int T = Law::tangents>
Real boundary_root(const Law &law, const Eigen::Matrix<Real, T + 1, 1> &tau,
                   Eigen::Matrix<Real, T, 1> &d) {
    constexpr int max_steps = 100; // ends by itself (46 in double precision, secular.h): no choice
    const Real n = tau[T];
    Eigen::Matrix<Real, T, 1> a, b, c;
    Real s = 0.0L;
    for (int i = 0; i < T; ++i) {
        const Real mu = divisor(law, i), mu2 = mu * mu;
        a[i] = mu * std::abs(tau[i]);
        b[i] = 1.0L + mu2;
        c[i] = n > 0.0L ? mu2 * n : -n;
        s = std::max(s, (a[i] - c[i]) / b[i]);
    }
    for (int step = 0; step < max_steps; ++step) {
        Real phi = 0.0L, slope = 0.0L;
        for (int i = 0; i < T; ++i) {
            d[i] = b[i] * s + c[i];
            const Real e = d[i] > 0.0L ? a[i] / d[i] : 0.0L;
            phi += e * e;
            slope += d[i] > 0.0L ? e * e * (b[i] / d[i]) : 0.0L;
        }
        const Real next = s + phi * (std::sqrt(phi) - 1.0L) / slope;
        if (!(next > s))
            break;
        s = next;
    }
    return s;
}

/// Euclidean projection on the cone, in place.
template <class Law, int T = Law::tangents>
Branch project_exactly(const Law &law, Eigen::Matrix<Real, T + 1, 1> &tau) {
    Real polar2 = 0.0L, ellipse2 = 0.0L;
    for (int i = 0; i < T; ++i) {
        const Real mu = divisor(law, i), dual = mu * tau[i], x = tau[i] / mu;
        polar2 += dual * dual;
        ellipse2 += x * x;
    }
    if (std::sqrt(polar2) <= -tau[T]) {
        tau.setZero();
        return Branch::open;
    }
    if (std::sqrt(ellipse2) <= tau[T])
        return inside(law);
    if constexpr (T > 0) {
        Eigen::Matrix<Real, T, 1> d;
        const Real R = std::max(tau[T], 0.0L) + boundary_root(law, tau, d);
        for (int i = 0; i < T; ++i)
            tau[i] *= R * divisor(law, i) * divisor(law, i) / d[i];
        tau[T] = R;
    }
    return Branch::slip;
}

/// Fills in defect, slip and branch. Without reaction there is no direction of slip.
template <class Law, int T = Law::tangents>
void judge_exactly(const Law &law, Real kappa, ExactState<T> &at) {
    const Eigen::Matrix<Real, T, 1> moved = at.w.template head<T>();
    Eigen::Matrix<Real, T + 1, 1> tau = predictor(law, at.r, at.w[T], moved, kappa);
    at.branch = project_exactly(law, tau);
    at.defect = at.r - tau;
    at.slip.setZero();
    if (!at.r.isZero(0.0L))
        at.slip = slip_defect(law, at.r, moved, at.branch);
}
} // namespace dolfinx_contact::condensed
