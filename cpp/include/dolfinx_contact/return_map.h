// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file return_map.h
/// Predictor without the translated normal term, projection of the tangential part in the metric
/// that has the slip rule as its normal. Same fixed points as the maps of bipotential.h.
#pragma once

#include "friction_cone.h"
#include "slip_rule.h"

namespace dolfinx_contact {
/// R = max(0, r_n - rho_n x_n), tau = r_t - rho_t du_t, z = M^-1 tau. The node sticks if |z| <= R;
/// else the new reaction is (M x, R) with x the point of the circle |x| = R for which
/// tau - M x is along the slip rule: x_i (1 + lambda / p_i^2) = z_i, lambda > 0.
///
/// With x = R e and s = lambda R / |z| this is the secular equation
/// e_i = (z_i / |z|) / (s / p_i^2 + R / |z|), |e| = 1.
template <class Law, int T = Law::tangents>
Reaction<T> return_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                       double rho_n, double rho_t) {
    const double n = r[T] - rho_n * gap;
    Reaction<T> result{Local<T>::Zero(), Branch::open};
    if (n <= 0.0)
        return result;
    result.r[T] = n;
    result.branch = Branch::slip;
    if constexpr (!is_frictionless<Law>) {
        Tangent<T> tau, z;
        for (int i = 0; i < T; ++i) {
            tau[i] = r[i] - rho_t * slip[i];
            z[i] = tau[i] / divisor(law, i);
        }
        const double length = norm<T>(z);
        if (length <= n) {
            result.r.template head<T>() = tau;
            result.branch = inside_branch(law);
            return result;
        }
        Tangent<T> e = z / length;
        if constexpr (!is_isotropic<Law>)
            e = secular_root<T>(e, inverse_p_squared(law), Tangent<T>::Constant(n / length)).e;
        for (int i = 0; i < T; ++i)
            result.r[i] = law.mu(i) * (n * e[i]);
    }
    return result;
}
} // namespace dolfinx_contact
