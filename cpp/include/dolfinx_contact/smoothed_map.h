// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file smoothed_map.h
/// The return map with the corner between sticking and slipping rounded off: for Newton's method
/// with a rounding that is taken back, not for loops that have to be fast.
#pragma once

#include "return_map.h"

namespace dolfinx_contact {
/// The equation, for t >= 0,
///
///     |e| = t / (t + k),   e_i d_i = a_i,   d_i = b_i (t + k) + c,   b_i > 0,  c >= 0,  k > 0.
template <int T> struct RoundedEquation {
    Tangent<T> a, b;
    double c, k;

    /// Bound on the Newton steps, with that of secular.h for k -> 0.
    static constexpr int max_steps = 60;

    /// t if |e| is length / (b (t + k) + c): of  b t^2 + (c + b k - length) t = k length  the root
    /// that is not negative, in the form without a difference.
    double root_for(double length, double b) const {
        const double linear = (c - length) + b * k;
        const double root = std::hypot(linear, 2.0 * std::sqrt(b) * std::sqrt(k * length));
        return linear < 0.0 ? (root - linear) / (2.0 * b) : 2.0 * k * length / (linear + root);
    }

    /// Left of the root: the largest of the roots for one component of e alone, for either, and for
    /// the tangent plane of 1 / |e| where all d_i are equal, which is exact where all b_i are.
    double start() const {
        const double length = norm<T>(a);
        double t = root_for(length, b.dot((a / (length + tiny)).cwiseAbs2()));
        for (int i = 0; i < T; ++i)
            t = std::max(t, root_for(std::abs(a[i]), b[i]));
        return t;
    }
};

/// Its root, with s = t + k; gives the number of Newton steps if `steps` is given.
///
/// 1 / |e| is increasing and concave in t (secular.h), and so is -1 - k / t: Newton's iterates for
/// 1 / |e| - 1 - k / t = 0 that start left of the root increase and stay there. They end when
/// rounding stops the increase.
template <int T> SecularRoot<T> solve(const RoundedEquation<T> &equation, int *steps = nullptr) {
    SecularRoot<T> root;
    double t = equation.start();
    for (int step = 0;; ++step) {
        root.s = t + equation.k;
        root.d = root.s * equation.b + Tangent<T>::Constant(equation.c);
        root.e = equation.a.cwiseQuotient(root.d);
        const double length = norm<T>(root.e);
        const Tangent<T> unit = root.e / (length + tiny);
        const double slope = unit.cwiseAbs2().dot(equation.b.cwiseQuotient(root.d));
        const double next =
            t + (length * root.s - t) / (slope * t + length * (equation.k / t)); // NaN for a = 0
        if (steps != nullptr)
            *steps = step;
        if (!(next > t) || step == RoundedEquation<T>::max_steps)
            return root;
        t = next;
    }
}

/// Equation of the smoothed map for a predictor tau with R = tau_n > 0, eps = rho_t rounding. With
/// b_i = min q / q_i and all lengths divided by a power of two L it is that for x = R e,
/// k = eps / (L min q) and s = lambda R / (L min q), a = z / L, c = R / L.
template <class Law, int T = Law::tangents>
RoundedEquation<T> smoothed_equation(const Law &law, const Local<T> &tau, double eps) {
    const Tangent<T> z = in_units_of_ellipse(law, tau), b = inverse_p_squared(law);
    const double k = eps / b.minCoeff();
    const double down = power_of_two(std::max({largest<T>(z), tau[T], k})).down;
    return {z * down, b, tau[T] * down, k * down};
}

/// Derivative by (tau, R): with the unit vector u along e, g_i = c u_i / d_i, v_i = s b_i e_i /
/// d_i, S = k / s + u . v,  dx_i = c dz_i / d_i - v_i (g . dz - dR) / S.
template <class Law, int T = Law::tangents>
Jacobian<T> smoothed_derivative(const Law &law, const RoundedEquation<T> &equation,
                                const SecularRoot<T> &root) {
    const Tangent<T> u = root.e / (norm<T>(root.e) + tiny), // zero for e = 0
        back = Tangent<T>::Constant(equation.c).cwiseQuotient(root.d), g = u.cwiseProduct(back),
                     v = root.e.cwiseProduct((root.s * equation.b).cwiseQuotient(root.d));
    const double S = equation.k / root.s + u.dot(v);
    Jacobian<T> J = Jacobian<T>::Zero();
    for (int i = 0; i < T; ++i) {
        for (int j = 0; j < T; ++j)
            J(i, j) = -law.mu(i) * v[i] * g[j] / (S * law.mu(j));
        J(i, i) += back[i];
        J(i, T) = law.mu(i) * v[i] / S;
    }
    J(T, T) = 1.0;
    return J;
}

/// With R, tau, z as in return_map and q_i = p_i^2 / max p^2 the new reaction is (M x, R),
///
///     x_i (1 + lambda / q_i) = z_i,   lambda (R - |x|) = rho_t rounding,   lambda > 0,
///
/// where return_map has lambda (R - |x|) = 0. A fixed point with r_n > 0 has no gap and obeys
///
///     du_i = -s r_i / q_i,   s (r_n - |M^-1 r_t|) = rounding,
///
/// whatever rho_n, rho_t: `rounding` >= 0 is a length, and the law the limit for rounding -> 0. The
/// normal part is not smoothed. For rounding = 0, or where mu = 0, this is return_map; the branch
/// is that of return_map in any case.
///
/// With x0 that of return_map, sum q_i (x_i - x0_i)^2 <= rho_t rounding R: x0 is a projection,
/// hence sum q_i (z_i - x0_i) (x_i - x0_i) <= 0, while q_i (z_i - x_i) = lambda x_i.
///
/// The derivative is Lipschitz continuous where R > 0, its own derivative jumps where z = 0.
///
/// If `derivative` is given, it receives the derivative by (tau, r_n - rho_n x_n).
template <class Law, int T = Law::tangents>
Reaction<T> smoothed_map(const Law &law, const Local<T> &r, double gap, const Tangent<T> &slip,
                         double rho_n, double rho_t, double rounding,
                         Jacobian<T> *derivative = nullptr) {
    if constexpr (T > 0) {
        const Start<T> start = start_return(law, r, gap, slip, rho_n, rho_t);
        if (start.branch > 0.0 && law.mu(0) > 0.0) {
            const RoundedEquation<T> equation = smoothed_equation(law, start.r, rho_t * rounding);
            if (equation.k > 0.0) {
                const SecularRoot<T> root = solve(equation);
                if (derivative != nullptr)
                    *derivative = smoothed_derivative(law, equation, root);
                return {return_point(law, start.scale, root),
                        start.branch == unfinished ? Branch::slip : branch_of(start.branch)};
            }
        }
    }
    return return_map(law, r, gap, slip, rho_n, rho_t, derivative);
}

/// smoothed_map with its derivatives.
template <class Law, int T = Law::tangents>
Linearisation<T> smoothed_jacobian(const Law &law, const Local<T> &r, double gap,
                                   const Tangent<T> &slip, double rho_n, double rho_t,
                                   double rounding) {
    Linearisation<T> out;
    out.value = smoothed_map(law, r, gap, slip, rho_n, rho_t, rounding, &out.by_reaction);
    out.by_motion = return_by_motion<T>(out.by_reaction, rho_n, rho_t);
    return out;
}
} // namespace dolfinx_contact
