// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file return_map.h
/// Predictor without the translated normal term, projection of the tangential part in the metric
/// that has the slip rule as its normal. Same fixed points as the maps of bipotential.h.
#pragma once

#include "bipotential.h"
#include "slip_rule.h"

namespace dolfinx_contact {
/// Secular equation of the boundary branch: a = z / |z|, b_i = 1 / p_i^2, c_i = R / |z|.
template <class Law, int T = Law::tangents>
SecularEquation<T> return_equation(const Law &law, const Tangent<T> &z, double R) {
    const double length = norm<T>(z);
    return {z / length, inverse_p_squared(law), Tangent<T>::Constant(R / length)};
}

/// Boundary point R (M e, 1).
template <class Law, int T = Law::tangents>
Local<T> return_point(const Law &law, double R, const SecularRoot<T> &root) {
    Local<T> r;
    for (int i = 0; i < T; ++i)
        r[i] = law.mu(i) * (R * root.e[i]);
    r[T] = R;
    return r;
}

/// Derivative of the boundary branch by (tau, R): with c = R / |z|, g_i = e_i / d_i, v_i = g_i /
/// p_i^2, S = sum e_i v_i,  dx_i = c dz_i / d_i - v_i (c g . dz - dR) / S.
template <class Law, int T = Law::tangents>
Jacobian<T> return_derivative(const Law &law, const SecularEquation<T> &equation,
                              const SecularRoot<T> &root) {
    const double c = equation.c[0];
    const Tangent<T> g = root.e.cwiseQuotient(root.d), v = g.cwiseProduct(equation.b);
    const double S = root.e.dot(v);
    Jacobian<T> J = Jacobian<T>::Zero();
    for (int i = 0; i < T; ++i) {
        const double mu = divisor(law, i);
        for (int j = 0; j < T; ++j)
            J(i, j) = -c * mu * v[i] * g[j] / (S * divisor(law, j));
        J(i, i) += c / root.d[i];
        J(i, T) = mu * v[i] / S;
    }
    J(T, T) = 1.0;
    return J;
}

/// With R = max(0, r_n - rho_n x_n), tau = r_t - rho_t du_t, z = M^-1 tau: the node sticks if
/// |z| <= R, else the new reaction is (M x, R) with x the point of the circle |x| = R for which
/// tau - M x is along the slip rule: x_i (1 + lambda / p_i^2) = z_i, lambda > 0.
///
/// With x = R e and s = lambda R / |z| this is the secular equation
/// e_i d_i = z_i / |z|,  d_i = s / p_i^2 + R / |z|,  |e| = 1.
///
/// If `derivative` is given, it receives the derivative by (tau, r_n - rho_n x_n) on the branch
/// taken.
template <class Law, int T = Law::tangents>
Reaction<T> return_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                       double rho_n, double rho_t, Jacobian<T> *derivative = nullptr) {
    const double R = r[T] - rho_n * gap;
    const Tangent<T> tau = r.template head<T>() - rho_t * slip;
    Tangent<T> z;
    for (int i = 0; i < T; ++i)
        z[i] = tau[i] / divisor(law, i);
    Reaction<T> result{Local<T>::Zero(), Branch::open};
    if (!(R <= 0.0)) {
        if constexpr (T > 0)
            if (!(norm<T>(z) <= R)) {
                const SecularEquation<T> equation = return_equation(law, z, R);
                const SecularRoot<T> root = root_for(law, equation);
                if (derivative != nullptr)
                    *derivative = return_derivative(law, equation, root);
                return {return_point(law, R, root), Branch::slip};
            }
        result = {Local<T>::Constant(R), inside(law)};
        result.r.template head<T>() = tau;
    }
    if (derivative != nullptr)
        *derivative = derivative_off_boundary<T>(result.branch);
    return result;
}

/// Derivative by (du_t, x_n), of that by (tau, r_n - rho_n x_n).
template <int T>
Jacobian<T> return_by_motion(const Jacobian<T> &by_predictor, double rho_n, double rho_t) {
    Local<T> rho = Local<T>::Constant(rho_t);
    rho[T] = rho_n;
    return -by_predictor * rho.asDiagonal();
}

/// return_map with its derivatives on the branch taken.
template <class Law, int T = Law::tangents>
Linearisation<T> return_jacobian(const Law &law, const Local<T> &r, double gap,
                                 const Tangent<T> &slip, double rho_n, double rho_t) {
    Linearisation<T> out;
    out.value = return_map(law, r, gap, slip, rho_n, rho_t, &out.by_reaction);
    out.by_motion = return_by_motion<T>(out.by_reaction, rho_n, rho_t);
    return out;
}
} // namespace dolfinx_contact
