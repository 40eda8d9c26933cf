// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file secular.h
/// The scalar equation behind every projection on an ellipse.
#pragma once

#include "norm.h"
#include <limits>

namespace dolfinx_contact {
/// Root of a secular equation and the unit vector that belongs to it.
template <int T> struct SecularRoot {
    double s;
    Tangent<T> e; ///< e_i = a_i / (b_i s + c_i), |e| = 1
    int iterations;
};

/// More Newton steps than any input was seen to need; the loop cannot run longer.
inline constexpr int max_newton_steps = 60;

/// The root s >= 0 of
///
///     phi(s) = sum_i (a_i / (b_i s + c_i))^2 = 1,      b_i > 0,  c_i >= 0,  phi(0) >= 1,
///
/// for T = 2 a quartic in s. psi = phi^(-1/2) is a power mean of positive increasing affine
/// functions, hence increasing and concave: Newton's iterates for psi(s) = 1 that start left of the
/// root stay there and increase. The start, where one term alone gives phi = 1, is left of it.
/// All terms of phi are positive, so phi has full relative precision at any s.
template <int T>
SecularRoot<T> secular_root(const Tangent<T> &a, const Tangent<T> &b, const Tangent<T> &c) {
    SecularRoot<T> root{0.0, a, 0};
    for (int i = 0; i < T; ++i)
        root.s = std::max(root.s, (std::abs(a[i]) - c[i]) / b[i]);
    for (;; ++root.iterations) {
        double phi = 0.0, slope = 0.0;
        for (int i = 0; i < T; ++i) {
            const double d = b[i] * root.s + c[i];
            root.e[i] = a[i] / d;
            phi += root.e[i] * root.e[i];
            slope += root.e[i] * root.e[i] * (b[i] / d);
        }
        const double next = root.s + phi * (std::sqrt(phi) - 1.0) / slope;
        // Past the root only by rounding: monotone iterates have nowhere else to go.
        if (!(next > root.s) || root.iterations == max_newton_steps)
            return root;
        root.s = next;
    }
}
} // namespace dolfinx_contact
