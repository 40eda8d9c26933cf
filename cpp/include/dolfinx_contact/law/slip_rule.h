// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file slip_rule.h
/// The slip rule -du_t = dlambda P^-2 r_t / |P^-1 r_t| of [dSFMH07, Section 1].
#pragma once

#include "norm.h"

namespace dolfinx_contact {
/// 1 / p_i^2 = 1 / (mu_i q_i)^2, scaled to a maximum of 1.
template <class Real = double, class Law, int T = Law::tangents>
Tangent<T, Real> inverse_p_squared(const Law &law) {
    if constexpr (is_isotropic<Law>)
        return Tangent<T, Real>::Ones();
    else {
        Tangent<T, Real> p2;
        for (int i = 0; i < T; ++i) {
            const Real mu = divisor(law, i);
            p2[i] = mu * mu * law.q2(i);
        }
        return p2.cwiseInverse() * p2.minCoeff();
    }
}

/// Unit vector along P^-2 r_t, against which the node slips; zero for r_t = 0.
template <class Law, class Real, int T = Law::tangents>
Tangent<T, Real> against_slip(const Law &law, const Eigen::Matrix<Real, T + 1, 1> &r) {
    if constexpr (T == 0)
        return {};
    else {
        const Tangent<T, Real> r_t = r.template head<T>();
        const PowerOfTwo scale = power_of_two(static_cast<double>(largest<T>(r_t)));
        const Tangent<T, Real> d = inverse_p_squared<Real>(law).cwiseProduct(r_t * scale.down);
        const Real length = norm<T>(d);
        if (length > 0.0)
            return d / length;
        return Tangent<T, Real>::Zero();
    }
}

/// What of the slip increment the law does not explain, a length along each direction: du + |du| d
/// with d from against_slip on a slipping node, du on a sticking one, zero on an open or
/// frictionless one.
template <class Law, class Real, int T = Law::tangents>
Tangent<T, Real> slip_defect(const Law &law, const Eigen::Matrix<Real, T + 1, 1> &r,
                             const Eigen::Matrix<Real, T, 1> &slip, Branch branch) {
    if (branch == Branch::open || law.mu(0) == 0.0)
        return Tangent<T, Real>::Zero();
    if (branch == Branch::stick)
        return slip;
    return slip + norm<T>(slip) * against_slip(law, r);
}
} // namespace dolfinx_contact
