// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file bipotential.h
/// The bi-potential of [dSFMH07, Section 1]: predictor and corrector of Section 2, the same in
/// scaled variables, and the gap that certifies a solution.
#pragma once

#include "friction_cone.h"

namespace dolfinx_contact {
/// Q^2 du_t.
template <class Law, int T = Law::tangents>
Tangent<T> q2_slip(const Law &law, const Tangent<T> &slip) {
    Tangent<T> v;
    for (int i = 0; i < T; ++i)
        v[i] = law.q2(i) * slip[i];
    return v;
}

/// w_t = M Q^2 du_t, whose norm is the dual norm ||Q^2 (-du_t)||*_mu of [dSFMH07, Section 1].
template <class Law, int T = Law::tangents>
Tangent<T> scaled_slip(const Law &law, const Tangent<T> &slip) {
    Tangent<T> w;
    for (int i = 0; i < T; ++i)
        w[i] = law.mu(i) * (law.q2(i) * slip[i]);
    return w;
}

/// Predictor of [dSFMH07, Section 2]:
/// tau_t = r_t - rho Q^2 du_t,  tau_n = r_n - rho (x_n + |M Q^2 du_t|),  rho > 0 a stiffness.
template <class Law, int T = Law::tangents>
Local<T> predictor(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                   double rho) {
    Local<T> tau = r;
    if constexpr (is_frictionless<Law>)
        tau[T] -= rho * gap;
    else {
        const Tangent<T> v = q2_slip(law, slip);
        for (int i = 0; i < T; ++i)
            tau[i] -= rho * v[i];
        tau[T] -= rho * (gap + norm<T>(scaled_slip(law, slip)));
    }
    return tau;
}

/// Predictor and corrector of [dSFMH07, Section 2]: one step of the paper's fixed point.
template <class Law, int T = Law::tangents>
Reaction<T> bipotential_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                            double rho) {
    return project(law, predictor(law, r, gap, slip, rho));
}

/// The same predictor and corrector in the scaled variables (M^-1 r_t, r_n), (M Q^2 du_t, x_n +
/// |M Q^2 du_t|), in which the law is isotropic with unit friction and the projection has a closed
/// form. Same fixed points as bipotential_map, other iterates (unless M is the identity).
template <class Law, int T = Law::tangents>
Reaction<T> scaled_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                       double rho) {
    if constexpr (is_frictionless<Law>)
        return bipotential_map(law, r, gap, slip, rho);
    else {
        const Tangent<T> w = scaled_slip(law, slip);
        Tangent<T> t;
        for (int i = 0; i < T; ++i)
            t[i] = r[i] / divisor(law, i) - rho * w[i];
        const double n = r[T] - rho * (gap + norm<T>(w)), length = norm<T>(t);
        const bool inside = length <= n, apex = length <= -n;
        const double radius = inside ? n : (apex ? 0.0 : 0.5 * length + 0.5 * n);
        // length is zero only inside or at the apex
        const double shrink = inside ? 1.0 : (apex ? 0.0 : radius / length);
        Reaction<T> result{r, apex ? Branch::open : (inside ? inside_branch(law) : Branch::slip)};
        for (int i = 0; i < T; ++i)
            result.r[i] = law.mu(i) * (shrink * t[i]);
        result.r[T] = radius;
        return result;
    }
}

/// Gap of the bi-potential, b_c(-du, r) + du . r = r_n (x_n + |M Q^2 du_t|) + r_t . Q^2 du_t, force
/// times length, for r in the cone and x_n >= 0: non-negative, and zero exactly where the law
/// holds.
///
/// With x = M^-1 r_t, w = M Q^2 du_t and their unit vectors it is the sum of non-negative terms
///     r_n x_n + (r_n - |x|) |w| + |x| |w| |e_x + e_w|^2 / 2.
/// r_n - |x| below zero (r outside by rounding) counts as zero.
template <class Law, int T = Law::tangents>
double bipotential_gap(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip) {
    if constexpr (is_frictionless<Law>)
        return r[T] * gap;
    else {
        const Tangent<T> x = in_units_of_ellipse(law, Tangent<T>(r.template head<T>()));
        const Tangent<T> w = scaled_slip(law, slip);
        const double x_length = norm<T>(x), w_length = norm<T>(w);
        double work = r[T] * gap + std::max(r[T] - x_length, 0.0) * w_length;
        if (x_length > 0.0 && w_length > 0.0) {
            double chord2 = 0.0;
            for (int i = 0; i < T; ++i) {
                const double chord = x[i] / x_length + w[i] / w_length;
                chord2 += chord * chord;
            }
            work += 0.5 * x_length * w_length * chord2;
        }
        return work;
    }
}
} // namespace dolfinx_contact
