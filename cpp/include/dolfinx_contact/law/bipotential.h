// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file bipotential.h
/// The bi-potential of [dSFMH07, Section 1]: predictor and corrector of Section 2, the same in
/// scaled variables, the derivatives of both, and the gap that certifies a solution.
///
/// State of a node: reaction r (T+1,), gap x_n, slip increment du_t (T,). The metric rho > 0 is a
/// stiffness. Derivatives by the motion are by (du_t, x_n), shape (T+1,) in the local frame.
#pragma once

#include "friction_cone.h"

namespace dolfinx_contact {
/// A reaction, its branch, and its derivatives by the old reaction and by the motion.
template <int T> struct Linearisation {
    Reaction<T> value;
    Jacobian<T> by_reaction, by_motion;
};

/// w_t = M Q^2 du_t, whose norm is the dual norm ||Q^2 (-du_t)||*_mu of [dSFMH07, Section 1].
template <class Law, class Real, int T = Law::tangents>
Tangent<T, Real> scaled_slip(const Law &law, const Eigen::Matrix<Real, T, 1> &slip) {
    Tangent<T, Real> w;
    for (int i = 0; i < T; ++i)
        w[i] = law.mu(i) * (law.q2(i) * slip[i]);
    return w;
}

/// Predictor of [dSFMH07, Section 2]:
/// tau_t = r_t - rho Q^2 du_t,  tau_n = r_n - rho (x_n + |M Q^2 du_t|).
template <class Law, class Real, int T = Law::tangents>
Local<T, Real> predictor(const Law &law, const Eigen::Matrix<Real, T + 1, 1> &r, Real gap,
                         const Eigen::Matrix<Real, T, 1> &slip, Real rho) {
    Local<T, Real> tau;
    for (int i = 0; i < T; ++i)
        tau[i] = r[i] - rho * (law.q2(i) * slip[i]);
    tau[T] = r[T] - rho * (gap + norm<T>(scaled_slip(law, slip)));
    return tau;
}

/// Predictor and corrector of [dSFMH07, Section 2]: one step of the paper's fixed point.
template <class Law, int T = Law::tangents>
Reaction<T> bipotential_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                            double rho) {
    return project(law, predictor(law, r, gap, slip, rho));
}

/// The predictor in the scaled variables (M^-1 r_t, r_n), (M Q^2 du_t, x_n + |M Q^2 du_t|), in
/// which the law is isotropic with unit friction.
template <class Law, int T = Law::tangents>
Local<T> scaled_predictor(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                          double rho) {
    const Tangent<T> w = scaled_slip(law, slip);
    Local<T> tau;
    for (int i = 0; i < T; ++i)
        tau[i] = r[i] / divisor(law, i) - rho * w[i];
    tau[T] = r[T] - rho * (gap + norm<T>(w));
    return tau;
}

/// Predictor and corrector in the scaled variables; the projection on the unit cone has a closed
/// form. Same fixed points as bipotential_map, other iterates (unless M is the identity).
template <class Law, int T = Law::tangents>
Reaction<T> scaled_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                       double rho) {
    const Local<T> tau = scaled_predictor(law, r, gap, slip, rho);
    const Tangent<T> t = tau.template head<T>();
    const double n = tau[T], length = norm<T>(t);
    if (length <= -n)
        return {Local<T>::Zero(), Branch::open};
    const bool on_boundary = !(length <= n);
    const double radius = on_boundary ? 0.5 * length + 0.5 * n : n;
    const double shrink = on_boundary ? radius / length : 1.0;
    Reaction<T> result{tau, on_boundary ? Branch::slip : inside(law)};
    for (int i = 0; i < T; ++i)
        result.r[i] = law.mu(i) * (shrink * t[i]);
    result.r[T] = radius;
    return result;
}

/// Unit vector along M Q^2 du_t. The dual norm has a kink at du_t = 0; there, the limit for a slip
/// against r_t, or along the first axis if that is zero too.
template <class Law, int T = Law::tangents>
Tangent<T> scaled_slip_direction(const Law &law, const Local<T> &r, const Tangent<T> &slip) {
    const Tangent<T> w = scaled_slip(law, slip), against = -in_units_of_ellipse(law, r);
    if (const double length = norm<T>(w); length > 0.0)
        return w / length;
    if (const double length = norm<T>(against); length > 0.0)
        return against / length;
    Tangent<T> first = Tangent<T>::Zero();
    if constexpr (T > 0)
        first[0] = 1.0;
    return first;
}

/// d tau / d (du_t, x_n) of a predictor with tangential part -rho diag(tangential) du_t.
template <class Law, int T = Law::tangents>
Jacobian<T> predictor_by_motion(const Law &law, const Tangent<T> &tangential,
                                const Tangent<T> &direction, double rho) {
    Jacobian<T> J = Jacobian<T>::Zero();
    for (int i = 0; i < T; ++i) {
        J(i, i) = -rho * tangential[i];
        J(T, i) = -rho * (law.mu(i) * law.q2(i) * direction[i]);
    }
    J(T, T) = -rho;
    return J;
}

/// bipotential_map with its derivatives on the branch taken.
template <class Law, int T = Law::tangents>
Linearisation<T> bipotential_jacobian(const Law &law, const Local<T> &r, double gap,
                                      const Tangent<T> &slip, double rho) {
    Tangent<T> q2;
    for (int i = 0; i < T; ++i)
        q2[i] = law.q2(i);
    Linearisation<T> out;
    out.value = project(law, predictor(law, r, gap, slip, rho), &out.by_reaction);
    out.by_motion =
        out.by_reaction * predictor_by_motion(law, q2, scaled_slip_direction(law, r, slip), rho);
    return out;
}

/// scaled_map with its derivatives on the branch taken.
template <class Law, int T = Law::tangents>
Linearisation<T> scaled_jacobian(const Law &law, const Local<T> &r, double gap,
                                 const Tangent<T> &slip, double rho) {
    Local<T> scale = Local<T>::Ones(), inverse = Local<T>::Ones();
    Tangent<T> mu_q2;
    for (int i = 0; i < T; ++i) {
        scale[i] = divisor(law, i);
        inverse[i] = 1.0 / scale[i];
        mu_q2[i] = law.mu(i) * law.q2(i);
    }
    Jacobian<T> J;
    const Local<T> tau = scaled_predictor(law, r, gap, slip, rho);
    if constexpr (T == 0)
        project(law, tau, &J);
    else
        project(Isotropic<T>{1.0}, tau, &J);
    J = scale.asDiagonal() * J;
    return {scaled_map(law, r, gap, slip, rho), J * inverse.asDiagonal(),
            J * predictor_by_motion(law, mu_q2, scaled_slip_direction(law, r, slip), rho)};
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
    const Tangent<T> x = in_units_of_ellipse(law, r), w = scaled_slip(law, slip);
    const double x_length = norm<T>(x), w_length = norm<T>(w);
    double chord2 = 0.0;
    for (int i = 0; i < T; ++i) {
        const double chord = x[i] / (x_length + tiny) + w[i] / (w_length + tiny);
        chord2 += chord * chord;
    }
    return r[T] * gap + std::max(r[T] - x_length, 0.0) * w_length +
           0.5 * (x_length * w_length) * chord2;
}
} // namespace dolfinx_contact
