// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file friction_cone.h
/// The elliptic friction cone K_mu of [dSFMH07, Eq. (1)]: load function, Euclidean projection and
/// its derivative.
#pragma once

#include "secular.h"
#include <limits>

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

/// A projection on the cone, up to the root of a secular equation where one is needed.
template <int T> struct Projection {
    Reaction<T> result;          ///< valid unless unfinished
    bool unfinished;             ///< a boundary point of which the root is not known yet
    SecularEquation<T> equation; ///< of the unfinished
    double R0, R1;               ///< the boundary point is R (M e, 1) with R = R0 + R1 s
};

/// The boundary point R (M e, 1), |e| = 1, that a root stands for.
template <class Law, int T = Law::tangents>
Reaction<T> finish(const Law &law, const Projection<T> &start, const SecularRoot<T> &root) {
    Reaction<T> result{Local<T>::Zero(), Branch::slip};
    result.r[T] = start.R0 + start.R1 * root.s;
    for (int i = 0; i < T; ++i)
        result.r[i] = law.mu(i) * (result.r[T] * root.e[i]);
    return result;
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

/// The root where all b_i and all c_i are the same.
template <int T> SecularRoot<T> isotropic_root(const SecularEquation<T> &equation) {
    const double length = norm<T>(equation.a);
    return {(length - equation.c[0]) / equation.b[0], Tangent<T>::Constant(length),
            equation.a / length};
}

/// First part of project: the branch, and the result or the equation for it.
template <class Law, int T = Law::tangents>
Projection<T> start_projection(const Law &law, const Local<T> &tau) {
    const PowerOfTwo scale = power_of_two(largest<T + 1>(tau));
    Local<T> p = tau;
    double sum = 0.0, polar2 = 0.0, ellipse2 = 0.0;
    for (int i = 0; i <= T; ++i) {
        p[i] *= scale.down;
        sum += p[i];
    }
    const double n = p[T];
    for (int i = 0; i < T; ++i) {
        const double dual = p[i] * divisor(law, i), x = p[i] / divisor(law, i);
        polar2 += dual * dual;
        ellipse2 += x * x;
    }
    Projection<T> start{{tau, Branch::slip}, false, {}, std::max(tau[T], 0.0), scale.up};
    if (!std::isfinite(sum))
        start.result.r.setConstant(std::numeric_limits<double>::quiet_NaN());
    else if (std::sqrt(polar2) <= -n) // tau in the polar cone, the apex included
        start.result = {Local<T>::Zero(), Branch::open};
    else if (std::sqrt(ellipse2) <= n)
        start.result.branch = inside_branch(law);
    else if constexpr (T > 0) {
        start.unfinished = true;
        start.equation = boundary_equation(law, p);
    }
    return start;
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
/// tau with an infinite or NaN component gives NaN and Branch::slip. If `derivative` is given, it
/// receives d r / d tau on the branch taken, at a kink one of the limits of derivatives nearby.
template <class Law, int T = Law::tangents>
Reaction<T> project(const Law &law, const Local<T> &tau, Jacobian<T> *derivative = nullptr) {
    const Projection<T> start = start_projection(law, tau);
    if (derivative) {
        const bool inside = !start.unfinished && start.result.branch != Branch::open;
        *derivative =
            start.result.r[T] * 0.0 + (inside ? 1.0 : 0.0) * Jacobian<T>::Identity().array();
    }
    if constexpr (T > 0)
        if (start.unfinished) {
            const SecularRoot<T> root =
                is_isotropic<Law> ? isotropic_root<T>(start.equation) : solve<T>(start.equation);
            if (derivative)
                *derivative = boundary_derivative(law, tau[T] / start.R1, root);
            return finish(law, start, root);
        }
    return start.result;
}
} // namespace dolfinx_contact
