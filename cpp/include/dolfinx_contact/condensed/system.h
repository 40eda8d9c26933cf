// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file system.h
/// The contact problem condensed to the contact nodes, w = q + W r, in the scaled variables in
/// which every law is the isotropic one with unit friction, and its residual after Alart and
/// Curnier.
#pragma once

#include "../law/law.h"
#include "operator.h"

namespace dolfinx_contact::condensed {
/// The coefficients of friction of all nodes, (n, T); the metric of a scaled variable needs no
/// more.
template <int T> struct Coefficients {
    Eigen::Array<double, Eigen::Dynamic, T> mu, q2;

    Coefficients(const AnyLaw<T> &any, Index nodes) : mu(nodes, T), q2(nodes, T) {
        std::visit(
            [&](const auto &source) {
                for (Index i = 0; i < nodes; ++i) {
                    const auto &law = source(static_cast<std::size_t>(i));
                    for (int c = 0; c < T; ++c) {
                        mu(i, c) = law.mu(c);
                        q2(i, c) = law.q2(c);
                    }
                }
            },
            any);
    }

    bool frictionless() const { return (mu == 0.0).all(); }
};

/// w = left * (q + W (right * r)) with r and w dimensionless and scaled: r_t in units of mu R, w_t
/// in units of U / (mu q^2), so that r in C, (w_t, w_n + |w_t|) in C, orthogonal, C = {|r_t| <=
/// r_n}. T tangential directions; T = 0 is a problem without friction, of which W keeps the normal
/// rows.
template <int T> struct System {
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;

    const Square *W;          // physical
    const Square *inverse;    // of W, or null
    const Poll *poll;         // of long factorisations
    VectorXd q;               // physical
    VectorXd left, right;     // scaled over physical displacements, physical over scaled reactions
    VectorXd rho_n, rho_t;    // metric of the residual, per node
    std::vector<bool> smooth; // node without friction
    Index nodes, tied;        // tied rows come last: w_c = 0, r_c of any sign
    bool accurate = false;    // displacements in twice the precision
    VectorXd own;             // compliance of each contact to its own normal reaction; physical
    double shift = 0.0;       // added to the diagonal of W at contacts, over `own`

    Index size() const { return D * nodes + tied; }

    VectorXd displacement(const VectorXd &r) const {
        const VectorXd forces = right.cwiseProduct(r);
        if (accurate && shift == 0.0)
            return left.cwiseProduct(W->accurate(q, forces).template cast<double>());
        return left.cwiseProduct(q + *W * forces + shifted(forces));
    }
    VectorXd change(const VectorXd &dr) const {
        const VectorXd forces = right.cwiseProduct(dr);
        return left.cwiseProduct(*W * forces + shifted(forces));
    }
    /// What `shift` adds to a displacement.
    VectorXd shifted(const VectorXd &forces) const {
        VectorXd moved = VectorXd::Zero(size());
        for (Index i = 0; i < nodes && shift > 0.0; ++i)
            moved.template segment<D>(D * i) = shift * own[i] * forces.template segment<D>(D * i);
        return moved;
    }
    VectorXd change_of_reaction(const VectorXd &dw) const {
        return (*inverse * VectorXd(dw.cwiseQuotient(left))).cwiseQuotient(right);
    }

    /// Metric of the residual: rho_n = 10 / W_nn and rho_t = 1 / max(W_xx, W_yy). The normal and
    /// the tangential step want their own.
    void set_metric() {
        const VectorXd diagonal = left.array() * W->diagonal().array().abs() * right.array().abs();
        double mean = 0.0;
        for (Index i = 0; i < nodes; ++i)
            mean += diagonal[D * i + T] / static_cast<double>(nodes);
        rho_n.resize(nodes);
        rho_t.setOnes(nodes);
        for (Index i = 0; i < nodes; ++i) {
            // a node that its own reaction does not move takes part in the others' scale
            const double floor = Tuning::negligible * (mean > 0.0 ? mean : 1.0);
            rho_n[i] = Tuning::rho_n / std::max(diagonal[D * i + T], floor);
            if constexpr (T > 0) {
                const auto of = [i](const VectorXd &v) {
                    return v.template segment<T>(D * i).array();
                };
                const double per_scale = mean / (left[D * i + T] * right[D * i + T]);
                const double floor_t = Tuning::negligible * (per_scale > 0.0 ? per_scale : 1.0) *
                                       (of(left) * of(right)).maxCoeff();
                rho_t[i] = Tuning::rho_t / std::max(of(diagonal).maxCoeff(), floor_t);
            }
        }
    }
};

/// Residual of a node, the branch it is on and what the derivative needs there.
template <int T> struct Point {
    static constexpr int D = T + 1;
    Eigen::Matrix<double, D, 1> mapped; // reaction that the law returns; in the cone
    Eigen::Matrix<double, D, 1> F;      // r - mapped
    Eigen::Matrix<double, T, 1> e;      // direction of tau, if slipping
    double a;                           // nu / |tau| < 1, if slipping
    Branch branch;
};

/// F = r - (tau min(1, nu / |tau|), nu) with nu = max(0, r_n - rho_n w_n), tau = r_t - rho_t w_t
/// [P. Alart, A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991)], of the scaled law.
template <int T, class Vector>
Point<T> residual(const System<T> &system, Index i, const Vector &r, const Vector &w) {
    constexpr int D = T + 1;
    Point<T> point;
    point.mapped.setZero();
    point.a = 0.0;
    point.branch = Branch::open;
    const double nu = r[T] - system.rho_n[i] * w[T];
    if (nu > 0.0) {
        point.mapped[T] = nu;
        point.branch = Branch::slip;
        if constexpr (T > 0) {
            if (!system.smooth[static_cast<std::size_t>(i)]) {
                const Eigen::Matrix<double, T, 1> tau =
                    r.template head<T>() - system.rho_t[i] * w.template head<T>();
                const double length = tau.norm();
                if (length <= nu) {
                    point.branch = Branch::stick;
                    point.mapped.template head<T>() = tau;
                } else {
                    point.e = tau / length;
                    point.a = nu / length;
                    point.mapped.template head<T>() = nu * point.e;
                }
            }
        }
    }
    point.F = r - point.mapped;
    static_assert(D == T + 1);
    return point;
}

/// Residuals of all nodes, half their squared norm with that of tied rows, F = w, and the reactions
/// that the law returns, those of tied rows as they are.
template <int T> struct State {
    std::vector<Point<T>> points;
    VectorXd tied;
    double merit = 0.0;

    void evaluate(const System<T> &system, const VectorXd &r, const VectorXd &w) {
        constexpr int D = T + 1;
        points.resize(static_cast<std::size_t>(system.nodes));
        double sum = 0.0;
        for (Index i = 0; i < system.nodes; ++i) {
            auto &point = points[static_cast<std::size_t>(i)];
            point = residual<T>(system, i, Eigen::Matrix<double, D, 1>(r.segment<D>(D * i)),
                                Eigen::Matrix<double, D, 1>(w.segment<D>(D * i)));
            sum += point.F.squaredNorm();
        }
        tied = r.tail(system.tied);
        merit = 0.5 * (sum + w.tail(system.tied).squaredNorm());
    }
    VectorXd mapped() const {
        constexpr int D = T + 1;
        VectorXd r(D * static_cast<Index>(points.size()) + tied.size());
        r.tail(tied.size()) = tied;
        for (std::size_t i = 0; i < points.size(); ++i)
            r.segment<D>(D * static_cast<Index>(i)) = points[i].mapped;
        return r;
    }
};
} // namespace dolfinx_contact::condensed
