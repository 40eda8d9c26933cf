// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file secular.h
/// The scalar equation behind every projection on an ellipse.
#pragma once

#include "norm.h"

namespace dolfinx_contact {
/// The equation, for s >= 0,
///
///     phi(s) = sum_i (a_i / d_i)^2 = 1,   d_i = b_i s + c_i,   b_i > 0,  c_i >= 0,  phi(0) >= 1.
///
/// For T = 2 it is a quartic in s.
template <int T> struct SecularEquation { Tangent<T> a, b, c; };

/// Its root, d, and the unit vector e with e_i d_i = a_i.
template <int T> struct SecularRoot {
    double s;
    Tangent<T> d, e;
    int steps = 0; ///< of Newton's method
};

/// Bound on the Newton steps. The slowest case is phi = 1 + k / s^2, one term being 1 from the
/// start: a step takes phi - 1 to 4/9 of it, from 1 to rounding in ln(2^53) / ln(9/4) = 46.
inline constexpr int max_secular_steps = 60;

/// psi = phi^(-1/2) is a power mean of the increasing affine functions d_i / |a_i|, hence
/// increasing and concave, and below its tangents: Newton's iterates for psi(s) = 1 are never right
/// of the root, from whatever start, and increase from the first on. They start at the largest of
/// the root for one term alone, for either term, and the root of the tangent plane of psi (as a
/// function of d) where all d_i are equal; all are left of the root, the last exact for b_1 = b_2,
/// c_1 = c_2. They end when rounding stops the increase. All terms of phi are positive, so that phi
/// has full relative precision at every s.
template <int T> SecularRoot<T> solve(const SecularEquation<T> &equation) {
    const auto &[a, b, c] = equation;
    SecularRoot<T> root{0.0, {}, {}};
    double length2 = 0.0, weighted_b = 0.0, weighted_c = 0.0;
    for (int i = 0; i < T; ++i) {
        const double a2 = a[i] * a[i];
        length2 += a2;
        weighted_b += a2 * b[i];
        weighted_c += a2 * c[i];
        root.s = std::max(root.s, (std::abs(a[i]) - c[i]) / b[i]);
    }
    root.s = std::max(root.s, (length2 * std::sqrt(length2) - weighted_c) / weighted_b);
    for (;; ++root.steps) {
        double phi = 0.0, slope = 0.0;
        for (int i = 0; i < T; ++i) {
            root.d[i] = b[i] * root.s + c[i];
            root.e[i] = a[i] / root.d[i];
            const double e2 = root.e[i] * root.e[i];
            phi += e2;
            slope += e2 * (b[i] / root.d[i]);
        }
        const double next = root.s + phi * (std::sqrt(phi) - 1.0) / slope;
        if (!(next > root.s) || root.steps == max_secular_steps)
            return root;
        root.s = next;
    }
}
} // namespace dolfinx_contact
