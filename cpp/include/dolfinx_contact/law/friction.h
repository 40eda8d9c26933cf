// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file friction.h
/// Coefficients of the friction law of one contact node.
///
/// [dSFMH07]: G. de Saxce, Z.-Q. Feng, Z. Mroz, M. Hjiaj, "Comportement hysteretique du frottement
/// anisotrope", 18e Congres Francais de Mecanique, 2007.
///
/// Local frame of a node: T tangential components along the principal friction directions, then the
/// normal one, pointing from the obstacle into the body. T = 1 in two dimensions, 2 in three; T = 0
/// is the frictionless law, which has no use for the tangential components and never sees them.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>

namespace dolfinx_contact {
/// Tangential vector, shape (T,). Real is double, or long double where errors are measured.
template <int T, class Real = double> using Tangent = Eigen::Matrix<Real, T, 1>;

/// Vector in the local frame, shape (T+1,): tangential components, then the normal one.
template <int T, class Real = double> using Local = Eigen::Matrix<Real, T + 1, 1>;

/// Derivative of a vector in the local frame by another, shape (T+1, T+1).
template <int T> using Jacobian = Eigen::Matrix<double, T + 1, T + 1>;

/// Which part of a projection was taken: the apex, the inside or the boundary of the friction cone.
/// It is the status of the node: without contact, sticking, slipping.
enum class Branch : std::uint8_t { open = 0, stick = 1, slip = 2 };

/// A reaction in the friction cone and the branch that gave it.
template <int T> struct Reaction {
    Local<T> r;
    Branch branch;
};

/// Coefficients of friction are zero (no friction) or between these bounds, and so is 1/q, so that
/// their squares and the squares of their ratios neither overflow nor vanish.
inline constexpr double min_coefficient = 1e-50, max_coefficient = 1e50;

// A law has mu(i), the principal coefficient of friction, diagonal of M (all positive or, at a node
// of a field, all zero), and q2(i), the square of the non-associativity Q = P M^-1 ([dSFMH07],
// Section 1), scaled to max(q2) = 1. Only the ratio of the p matters: P -> c P leaves the slip rule
// unchanged.

/// No friction: the cone is the half line r_n >= 0.
struct Frictionless {
    static constexpr const char *kind = "frictionless";
    static constexpr int tangents = 0;
    static constexpr double mu(int) { return 0.0; }
    static constexpr double q2(int) { return 1.0; }
};

/// One coefficient for all directions, slip against the friction force. Two-dimensional friction is
/// always of this kind.
template <int T> struct Isotropic {
    static constexpr const char *kind = "isotropic";
    static constexpr int tangents = T;
    double coefficient;
    double mu(int) const { return coefficient; }
    static constexpr double q2(int) { return 1.0; }
};

/// Orthotropic friction with the associated slip rule, P = M: slip is normal to the ellipse.
template <int T> struct Associated {
    static constexpr const char *kind = "associated";
    static constexpr int tangents = T;
    Tangent<T> coefficient;
    double mu(int i) const { return coefficient[i]; }
    static constexpr double q2(int) { return 1.0; }
};

/// Orthotropic friction with a slip rule of its own, P != M.
template <int T> struct NonAssociated {
    static constexpr const char *kind = "nonassociated";
    static constexpr int tangents = T;
    Tangent<T> coefficient, q_squared;
    double mu(int i) const { return coefficient[i]; }
    double q2(int i) const { return q_squared[i]; }
};

template <class Law> inline constexpr bool is_isotropic = false;
template <int T> inline constexpr bool is_isotropic<Isotropic<T>> = true;

/// mu(i) to divide by: a frictionless node of a field gets the smallest coefficient instead of
/// zero.
template <class Law> double divisor(const Law &law, int i) {
    return std::max(law.mu(i), min_coefficient);
}

/// Branch of a node inside the cone. Without friction there is no sticking.
template <class Law> Branch inside(const Law &law) {
    return law.mu(0) > 0.0 ? Branch::stick : Branch::slip;
}

/// Q = P M^-1 scaled to max(Q) = 1, so that Q is the identity exactly when the rule is associated
/// and the bi-potential gap does not depend on the scale of p.
template <int T> Tangent<T> normalised_q(const Tangent<T> &mu, const Tangent<T> &p) {
    const Tangent<T> q = (p / p.maxCoeff()).cwiseQuotient(mu);
    return q / q.maxCoeff();
}
} // namespace dolfinx_contact
