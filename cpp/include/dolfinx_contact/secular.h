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
};

/// Up to L such equations, solved together.
///
/// psi = phi^(-1/2) is a power mean of the increasing affine functions d_i / |a_i|, hence
/// increasing and concave, and below its tangents: Newton's iterates for psi(s) = 1 are never right
/// of the root, from whatever start, and increase from the first on. They start at the largest of
/// the root for one term alone, for either term, and the root of the tangent plane of psi (as a
/// function of d) where all d_i are equal; all are left of the root, the last exact for b_1 = b_2,
/// c_1 = c_2. They end when rounding stops the increase. All terms of phi are positive, so that phi
/// has full relative precision at every s.
template <int T, int L> class SecularEquations {
  public:
    /// Bound on the Newton steps. The slowest case is phi = 1 + k / s^2, one term being 1 from the
    /// start: a step takes phi - 1 to 4/9 of it, from 1 to rounding in ln(2^53) / ln(9/4) = 46.
    static constexpr int max_steps = 60;

    void set(int l, const SecularEquation<T> &equation) {
        double length2 = 0.0, weighted_b = 0.0, weighted_c = 0.0;
        s[l] = 0.0;
        for (int i = 0; i < T; ++i) {
            const double a2 = equation.a[i] * equation.a[i];
            a[i][l] = equation.a[i];
            b[i][l] = equation.b[i];
            c[i][l] = equation.c[i];
            length2 += a2;
            weighted_b += a2 * b[i][l];
            weighted_c += a2 * c[i][l];
            s[l] = std::max(s[l], (std::abs(a[i][l]) - c[i][l]) / b[i][l]);
        }
        s[l] = std::max(s[l], (length2 * std::sqrt(length2) - weighted_c) / weighted_b);
    }

    /// Solves the first `count` equations; gives the number of Newton steps.
    int solve(int count) {
        for (int steps = 0;; ++steps) {
            for (int l = 0; l < count; ++l) {
                double phi = 0.0, slope = 0.0;
                for (int i = 0; i < T; ++i) {
                    d[i][l] = b[i][l] * s[l] + c[i][l];
                    e[i][l] = a[i][l] / d[i][l];
                    const double e2 = e[i][l] * e[i][l];
                    phi += e2;
                    slope += e2 * (b[i][l] / d[i][l]);
                }
                next[l] = s[l] + phi * (std::sqrt(phi) - 1.0) / slope;
            }
            if (steps == max_steps)
                return steps;
            bool moved = false;
            for (int l = 0; l < count; ++l)
                if (next[l] > s[l]) {
                    s[l] = next[l];
                    moved = true;
                }
            if (!moved)
                return steps;
        }
    }

    SecularRoot<T> root(int l) const {
        SecularRoot<T> result;
        result.s = s[l];
        for (int i = 0; i < T; ++i) {
            result.d[i] = d[i][l];
            result.e[i] = e[i][l];
        }
        return result;
    }

  private:
    double a[T][L], b[T][L], c[T][L], d[T][L], e[T][L], s[L], next[L];
};

template <int T> SecularRoot<T> solve(const SecularEquation<T> &equation) {
    SecularEquations<T, 1> one;
    one.set(0, equation);
    one.solve(1);
    return one.root(0);
}
} // namespace dolfinx_contact
