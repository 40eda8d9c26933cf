// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file friction_cone.h
/// The elliptic friction cone K_mu of [dSFMH07, Eq. (1)]: load function and Euclidean projection.
#pragma once

#include "secular.h"

namespace dolfinx_contact {
/// M^-1 t, the tangential vector in units of the friction ellipse.
template <class Law, int T = Law::tangents>
Tangent<T> in_units_of_ellipse(const Law &law, const Tangent<T> &t) {
    Tangent<T> x;
    for (int i = 0; i < T; ++i)
        x[i] = t[i] / divisor(law, i);
    return x;
}

/// Load function f = |M^-1 r_t| - r_n, [dSFMH07, Eq. (1)]; f <= 0 is membership of the cone.
/// Without friction r_t is not looked at: f = -r_n.
template <class Law, int T = Law::tangents>
double load_function(const Law &law, const Local<T> &r) {
    if constexpr (is_frictionless<Law>)
        return -r[T];
    else
        return norm<T>(in_units_of_ellipse(law, Tangent<T>(r.template head<T>()))) - r[T];
}

/// Euclidean projection on the friction cone, the corrector of [dSFMH07, Section 2].
///
/// A boundary point is r = R (M e, 1) with a unit vector e. The optimality conditions
/// r_t + lambda M^-2 r_t = tau_t, R - lambda R = tau_n give, with lambda = (R - tau_n) / R,
///
///     e_i = mu_i tau_i / ((1 + mu_i^2) R - tau_n),      |e| = 1,
///
/// the quartic of the paper. The unknown is s = R - max(tau_n, 0), which leaves no difference in
/// the denominators. tau is scaled by a power of two first. Any finite tau gives a finite result;
/// tau with an infinite or NaN component gives NaN.
template <class Law, int T = Law::tangents>
Reaction<T> project(const Law &law, const Local<T> &tau) {
    if constexpr (is_frictionless<Law>) {
        Local<T> r = Local<T>::Zero();
        const bool open = tau[T] <= 0.0;
        r[T] = open ? 0.0 : tau[T];
        return {r, open ? Branch::open : Branch::slip};
    } else {
        double magnitude = std::abs(tau[T]);
        for (int i = 0; i < T; ++i)
            magnitude = std::max(magnitude, std::abs(tau[i]));
        const PowerOfTwo scale = power_of_two(magnitude);
        const double n = tau[T] * scale.down;
        Tangent<T> t, x, a;
        for (int i = 0; i < T; ++i) {
            t[i] = tau[i] * scale.down;
            x[i] = t[i] / divisor(law, i);
            a[i] = t[i] * divisor(law, i);
        }
        if (!std::isfinite(t.sum() + n))
            return {Local<T>::Constant(std::numeric_limits<double>::quiet_NaN()), Branch::slip};
        if (norm<T>(a) <= -n)
            return {Local<T>::Zero(), Branch::open};
        if (norm<T>(x) <= n)
            return {tau, inside_branch(law)};

        Reaction<T> result{tau, Branch::slip};
        if constexpr (is_isotropic<Law>) {
            const double mu = law.mu(0), length = norm<T>(t);
            result.r[T] = (mu * length + n) / (1.0 + mu * mu);
            for (int i = 0; i < T; ++i)
                result.r[i] = mu * result.r[T] * (t[i] / length);
        } else {
            Tangent<T> b, c;
            for (int i = 0; i < T; ++i) {
                const double mu2 = divisor(law, i) * divisor(law, i);
                b[i] = 1.0 + mu2;
                c[i] = n > 0.0 ? mu2 * n : -n;
            }
            const SecularRoot<T> root = secular_root<T>(a, b, c);
            result.r[T] = std::max(n, 0.0) + root.s;
            for (int i = 0; i < T; ++i)
                result.r[i] = law.mu(i) * result.r[T] * root.e[i];
        }
        result.r *= scale.up;
        return result;
    }
}
} // namespace dolfinx_contact
