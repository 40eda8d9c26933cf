// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file friction_cone.h
/// The elliptic friction cone K_mu of [dSFMH07, Eq. (1)]: load function, Euclidean projection and
/// its derivative.
#pragma once

#include "secular.h"

namespace dolfinx_contact {
/// M^-1 t, the tangential vector in units of the friction ellipse.
template <class Law, int T = Law::tangents>
Tangent<T> in_units_of_ellipse(const Law &law, const Local<T> &r) {
    Tangent<T> x;
    for (int i = 0; i < T; ++i)
        x[i] = r[i] / divisor(law, i);
    return x;
}

/// Load function f = |M^-1 r_t| - r_n, [dSFMH07, Eq. (1)]; f <= 0 is membership of the cone.
template <class Law, int T = Law::tangents>
double load_function(const Law &law, const Local<T> &r) {
    return norm<T>(in_units_of_ellipse(law, r)) - r[T];
}

/// The root of an equation that a law gave: closed form where all b_i and all c_i are the same.
template <class Law, int T = Law::tangents>
SecularRoot<T> root_for(const Law &, const SecularEquation<T> &equation) {
    if constexpr (is_isotropic<Law>) {
        const double length = norm<T>(equation.a);
        return {(length - equation.c[0]) / equation.b[0], Tangent<T>::Constant(length),
                equation.a / length};
    } else
        return solve<T>(equation);
}

/// Boundary branch of the Euclidean projection, for tau neither in the cone nor in its polar.
///
/// With a unit vector e the point sought is r = R (M e, 1). The optimality conditions
/// r_t + lambda M^-2 r_t = tau_t, R - lambda R = tau_n give, with lambda = (R - tau_n) / R,
///
///     e_i = mu_i tau_i / d_i,   d_i = (1 + mu_i^2) R - tau_n,   |e| = 1,
///
/// the quartic of [dSFMH07, Section 2]. The unknown is s = R - max(tau_n, 0), which leaves no
/// differences in the d_i.
template <class Law, int T = Law::tangents>
SecularEquation<T> boundary_equation(const Law &law, const Local<T> &tau) {
    SecularEquation<T> equation;
    for (int i = 0; i < T; ++i) {
        const double mu = divisor(law, i), mu2 = mu * mu;
        equation.a[i] = mu * tau[i];
        equation.b[i] = 1.0 + mu2;
        equation.c[i] = tau[T] > 0.0 ? mu2 * tau[T] : -tau[T];
    }
    return equation;
}

/// Boundary point of a Euclidean projection. R mu_i e_i = p_i (1 - g_i) = p_i R mu_i^2 / d_i with
/// g_i = (R - p_n) / d_i: of the two, the one with the smaller rounding error.
template <class Law, int T = Law::tangents>
Local<T> euclidean_point(const Law &law, const Local<T> &p, double scale,
                         const SecularRoot<T> &root) {
    const double R = std::max(p[T], 0.0) + root.s, drop = std::max(-p[T], 0.0) + root.s;
    Local<T> r;
    for (int i = 0; i < T; ++i) {
        const double g = drop / root.d[i], mu2 = law.mu(i) * law.mu(i);
        r[i] = (g < 0.5 ? p[i] - p[i] * g : p[i] * (R * mu2 / root.d[i])) * scale;
    }
    r[T] = R * scale;
    return r;
}

/// Derivative of a projection on the branches that are not the boundary.
template <int T> Jacobian<T> derivative_off_boundary(Branch branch) {
    Jacobian<T> J = Jacobian<T>::Zero();
    if (branch == Branch::stick)
        J.setIdentity();
    J(T, T) = branch == Branch::open ? 0.0 : 1.0;
    return J;
}

/// Derivative of the boundary branch, of degree zero in tau. With h_i = 1/d_i, v_i = mu_i e_i h_i
/// and S = sum e_i^2 (1 + mu_i^2) h_i, by differentiating e_i d_i = mu_i tau_i and |e| = 1:
///
///     ( diag(R h_i mu_i^2) - (tau_n/S) v v^T    v/S            )
///     ( v^T/S                                   sum e_i^2 h_i/S )
template <class Law, int T = Law::tangents>
Jacobian<T> boundary_derivative(const Law &law, double tau_n, const SecularRoot<T> &root) {
    const double R = std::max(tau_n, 0.0) + root.s;
    Tangent<T> v, diagonal;
    double S = 0.0, normal = 0.0;
    for (int i = 0; i < T; ++i) {
        const double mu = divisor(law, i), eh = root.e[i] / root.d[i];
        v[i] = mu * eh;
        diagonal[i] = mu * mu * (R / root.d[i]);
        S += root.e[i] * eh * (1.0 + mu * mu);
        normal += root.e[i] * eh;
    }
    Jacobian<T> J;
    J.template topLeftCorner<T, T>() = -(tau_n / S) * (v * v.transpose());
    J.template topLeftCorner<T, T>().diagonal() += diagonal;
    J.template topRightCorner<T, 1>() = v / S;
    J.template bottomLeftCorner<1, T>() = v.transpose() / S;
    J(T, T) = normal / S;
    return J;
}

/// Euclidean projection on the friction cone, the corrector of [dSFMH07, Section 2].
///
/// Any finite tau gives a finite result, at any magnitude: tau is scaled by a power of two first.
/// tau with an infinite or NaN component gives NaN. If `derivative` is given, it receives d r / d
/// tau on the branch taken, at a kink one of the limits of derivatives nearby.
template <class Law, int T = Law::tangents>
Reaction<T> project(const Law &law, const Local<T> &tau, Jacobian<T> *derivative = nullptr) {
    const PowerOfTwo scale = power_of_two(largest<T + 1>(tau));
    const Local<T> p = tau * scale.down;
    const double nan = 0.0 * p.sum(); // NaN if tau is not finite, else zero
    double polar2 = nan, ellipse2 = nan;
    for (int i = 0; i < T; ++i) {
        const double dual = p[i] * divisor(law, i), x = p[i] / divisor(law, i);
        polar2 += dual * dual;
        ellipse2 += x * x;
    }
    Reaction<T> result{tau, inside(law)};
    if (std::sqrt(polar2) <= -p[T]) { // tau in the polar cone, the apex included
        result = {Local<T>::Zero(), Branch::open};
    } else if (!(std::sqrt(ellipse2) <= p[T])) {
        if constexpr (T == 0) {
            result.r[T] += nan;
        } else {
            const SecularRoot<T> root = root_for(law, boundary_equation(law, p));
            if (derivative != nullptr)
                *derivative = boundary_derivative(law, p[T], root);
            return {euclidean_point(law, p, scale.up + nan, root), Branch::slip};
        }
    }
    if (derivative != nullptr)
        *derivative = derivative_off_boundary<T>(result.branch);
    return result;
}
} // namespace dolfinx_contact
