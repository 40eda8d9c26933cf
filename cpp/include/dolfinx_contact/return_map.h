// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file return_map.h
/// Predictor without the translated normal term, projection of the tangential part in the metric
/// that has the slip rule as its normal. Same fixed points as the maps of bipotential.h.
#pragma once

#include "bipotential.h"
#include "slip_rule.h"

namespace dolfinx_contact {
/// First part of return_map: the branch, and the result or the equation for it.
template <class Law, int T = Law::tangents>
Projection<T> start_return(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                           double rho_n, double rho_t) {
    const double n = r[T] - rho_n * gap;
    Projection<T> start{{Local<T>::Zero(), Branch::open}, false, {}, n, 0.0};
    if (n <= 0.0)
        return start;
    Tangent<T> z;
    start.result.r[T] = n;
    for (int i = 0; i < T; ++i) {
        start.result.r[i] = r[i] - rho_t * slip[i];
        z[i] = start.result.r[i] / divisor(law, i);
    }
    const double length = norm<T>(z);
    start.result.branch = inside_branch(law);
    if constexpr (T > 0)
        if (!(length <= n)) {
            start.unfinished = true;
            start.equation = {z / length, inverse_p_squared(law), Tangent<T>::Constant(n / length)};
        }
    return start;
}

/// With R = max(0, r_n - rho_n x_n), tau = r_t - rho_t du_t, z = M^-1 tau: the node sticks if
/// |z| <= R, else the new reaction is (M x, R) with x the point of the circle |x| = R for which
/// tau - M x is along the slip rule: x_i (1 + lambda / p_i^2) = z_i, lambda > 0.
///
/// With x = R e and s = lambda R / |z| this is the secular equation
/// e_i d_i = z_i / |z|,  d_i = s / p_i^2 + R / |z|,  |e| = 1.
///
/// If `derivative` is given, it receives the derivative by (tau, r_n - rho_n x_n) on the branch
/// taken: with c = R / |z|, g_i = e_i / d_i, v_i = g_i / p_i^2, S = sum e_i v_i,
///     dx_i = c dz_i / d_i - v_i (c g . dz - dR) / S.
template <class Law, int T = Law::tangents>
Reaction<T> return_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                       double rho_n, double rho_t, Jacobian<T> *derivative = nullptr) {
    const Projection<T> start = start_return(law, r, gap, slip, rho_n, rho_t);
    if (derivative)
        *derivative = (start.result.branch == Branch::open ? 0.0 : 1.0) * Jacobian<T>::Identity();
    if constexpr (T > 0)
        if (start.unfinished) {
            const SecularRoot<T> root =
                is_isotropic<Law> ? isotropic_root<T>(start.equation) : solve<T>(start.equation);
            if (derivative) {
                const double c = start.equation.c[0];
                const Tangent<T> g = root.e.cwiseQuotient(root.d),
                                 v = g.cwiseProduct(start.equation.b);
                const double S = root.e.dot(v);
                for (int i = 0; i < T; ++i) {
                    const double mu = divisor(law, i);
                    for (int j = 0; j < T; ++j)
                        (*derivative)(i, j) = -c * mu * v[i] * g[j] / (S * divisor(law, j));
                    (*derivative)(i, i) += c / root.d[i];
                    (*derivative)(i, T) = mu * v[i] / S;
                }
            }
            return finish(law, start, root);
        }
    return start.result;
}

/// return_map with its derivatives on the branch taken.
template <class Law, int T = Law::tangents>
Linearisation<T> return_jacobian(const Law &law, const Local<T> &r, double gap,
                                 const Tangent<T> &slip, double rho_n, double rho_t) {
    Linearisation<T> out;
    out.value = return_map(law, r, gap, slip, rho_n, rho_t, &out.by_reaction);
    Local<T> rho = Local<T>::Constant(rho_t);
    rho[T] = rho_n;
    out.by_motion = -out.by_reaction * rho.asDiagonal();
    return out;
}
} // namespace dolfinx_contact
