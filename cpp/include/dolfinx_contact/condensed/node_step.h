// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file node_step.h
/// The linearised contact problem of a node, with the unknowns eliminated that it gives directly.
#pragma once

#include "system.h"

namespace dolfinx_contact::condensed {
/// One Newton step of a node, with y the unknowns that are left. By compliance
/// dr = c + B y, L dw + G y = g; by stiffness dw = c + B y, L dr + G y = g.
template <int T> struct NodeStep {
    static constexpr int D = T + 1;
    int m = 0;
    Eigen::Matrix<double, D, D> B, L, G;
    Eigen::Matrix<double, D, 1> c, g;

    NodeStep() : B(), L(), G(), c(), g() {
        B.setZero();
        L.setZero();
        G.setZero();
        c.setZero();
        g.setZero();
    }
};

/// Linearisation with open nodes eliminated: open dr = -r; stick dw = -w; slip dw_n = -w_n,
/// dr_e - dr_n = rho_n w_n - F_e and (1 - a) dr_s + a rho_t dw_s = -F_s across e.
template <int T>
NodeStep<T> by_compliance(const System<T> &system, Index i, const Point<T> &at,
                          const Eigen::Matrix<double, T + 1, 1> &r,
                          const Eigen::Matrix<double, T + 1, 1> &w) {
    const double rho_n = system.rho_n[i], rho_t = system.rho_t[i];
    NodeStep<T> step;
    if (at.branch == Branch::open) {
        step.c = -r;
        return step;
    }
    // the normal row comes first
    step.m = 1;
    step.B(T, 0) = 1.0;
    step.L(0, T) = rho_n;
    step.g[0] = -rho_n * w[T];
    if constexpr (T > 0) {
        if (at.branch == Branch::stick) {
            step.m = T + 1;
            for (int c = 0; c < T; ++c) {
                step.B(c, 1 + c) = 1.0;
                step.L(1 + c, c) = rho_t;
                step.g[1 + c] = -rho_t * w[c];
            }
        } else if (system.smooth[static_cast<std::size_t>(i)]) {
            step.c.template head<T>() = -r.template head<T>();
        } else {
            const Eigen::Matrix<double, T, 1> F = at.F.template head<T>();
            step.B.col(0).template head<T>() = at.e;
            step.c.template head<T>() = (rho_n * w[T] - F.dot(at.e)) * at.e;
            if constexpr (T == 2) {
                const Eigen::Vector2d s(-at.e[1], at.e[0]);
                step.m = 2;
                step.B.col(1).template head<2>() = s;
                step.L.row(1).template head<2>() = at.a * rho_t * s.transpose();
                step.G(1, 1) = 1.0 - at.a;
                step.g[1] = -F.dot(s);
            }
        }
    }
    return step;
}

/// The same linearisation with sticking nodes eliminated; needs the inverse of W.
template <int T>
NodeStep<T> by_stiffness(const System<T> &system, Index i, const Point<T> &at,
                         const Eigen::Matrix<double, T + 1, 1> &r,
                         const Eigen::Matrix<double, T + 1, 1> &w) {
    const double rho_n = system.rho_n[i], rho_t = system.rho_t[i];
    NodeStep<T> step;
    if (at.branch == Branch::stick) {
        step.c = -w;
        return step;
    }
    if (at.branch == Branch::open) {
        step.m = T + 1;
        step.L.setIdentity();
        step.g = -r;
        step.B(T, T) = 1.0 / rho_n;
        for (int c = 0; c < T; ++c)
            step.B(c, c) = 1.0 / rho_t;
        return step;
    }
    step.c[T] = -w[T];
    if constexpr (T > 0) {
        step.m = T;
        if (system.smooth[static_cast<std::size_t>(i)]) {
            for (int c = 0; c < T; ++c) {
                step.B(c, c) = 1.0 / rho_t;
                step.L(c, c) = 1.0;
                step.g[c] = -r[c];
            }
        } else {
            const Eigen::Matrix<double, T, 1> F = at.F.template head<T>();
            step.B.col(0).template head<T>() = at.e / rho_t;
            step.L.row(0).template head<T>() = at.e.transpose();
            step.L(0, T) = -1.0;
            step.g[0] = rho_n * w[T] - F.dot(at.e);
            if constexpr (T == 2) {
                const Eigen::Vector2d s(-at.e[1], at.e[0]);
                step.B.col(1).template head<2>() = s / rho_t;
                step.L.row(1).template head<2>() = (1.0 - at.a) * s.transpose();
                step.G(1, 1) = at.a;
                step.g[1] = -F.dot(s);
            }
        }
    }
    return step;
}
} // namespace dolfinx_contact::condensed
