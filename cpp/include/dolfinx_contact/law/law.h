// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file law.h
/// The law of a whole contact, its kind chosen once: one set of coefficients for all nodes, or one
/// per node.
#pragma once

#include "friction.h"
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <variant>
#include <vector>

namespace dolfinx_contact {
/// The same coefficients at all nodes.
template <class L> struct Uniform {
    using Law = L;
    Law law;
    const Law &operator()(std::size_t) const { return law; }
};

/// Coefficients node by node.
template <class L> struct Field {
    using Law = L;
    std::vector<Law> laws;
    const Law &operator()(std::size_t node) const { return laws[node]; }
};

/// A law whose kind is known at run time. Visit it once per contact, not once per node. Friction in
/// two dimensions (T = 1) is isotropic.
template <int T> struct AnyLawOf;
template <> struct AnyLawOf<0> { using type = std::variant<Uniform<Frictionless>>; };
template <> struct AnyLawOf<1> {
    using type = std::variant<Uniform<Frictionless>, Uniform<Isotropic<1>>, Field<Isotropic<1>>>;
};
template <> struct AnyLawOf<2> {
    using type = std::variant<Uniform<Frictionless>, Uniform<Isotropic<2>>, Field<Isotropic<2>>,
                              Uniform<Associated<2>>, Field<Associated<2>>,
                              Uniform<NonAssociated<2>>, Field<NonAssociated<2>>>;
};
template <int T> using AnyLaw = typename AnyLawOf<T>::type;

namespace detail {
/// Relative difference below which p counts as proportional to mu: rounding.
inline constexpr double proportional = 4 * std::numeric_limits<double>::epsilon();

inline void require(bool condition, const char *what, double value) {
    if (condition)
        return;
    std::ostringstream message;
    message << what << ", not " << value;
    throw std::invalid_argument(message.str());
}

/// Coefficients of one node, p normalised.
template <int T> NonAssociated<T> checked(const Tangent<T> &mu, const Tangent<T> &p) {
    NonAssociated<T> law{mu, Tangent<T>::Ones()};
    if (mu.isZero(0.0))
        return law;
    for (int i = 0; i < T; ++i) {
        require(mu[i] >= min_coefficient && mu[i] <= max_coefficient,
                "mu must be zero in all directions or between 1e-50 and 1e50 in all", mu[i]);
        require(p[i] > 0.0 && std::isfinite(p[i]), "p must be positive and finite", p[i]);
    }
    const Tangent<T> q = normalised_q<T>(mu, p);
    require(q.minCoeff() >= min_coefficient,
            "the smallest p/mu must be at least 1e-50 of the largest", q.minCoeff());
    if (1.0 - q.minCoeff() > proportional)
        law.q_squared = q.cwiseAbs2();
    return law;
}

/// All nodes converted to the law that `convert` gives.
template <int T, class Convert>
AnyLaw<T> collect(const std::vector<NonAssociated<T>> &nodes, bool uniform, Convert convert) {
    using Law = decltype(convert(nodes.front()));
    if (uniform)
        return Uniform<Law>{convert(nodes.front())};
    Field<Law> field;
    field.laws.reserve(nodes.size());
    std::transform(nodes.begin(), nodes.end(), std::back_inserter(field.laws), convert);
    return field;
}
} // namespace detail

/// The law with the coefficients mu and p of all nodes alike (`uniform`, one entry) or of each
/// node: the simplest kind that has them. Throws std::invalid_argument where mu or p is out of
/// range.
template <int T>
AnyLaw<T> make_law(const std::vector<Tangent<T>> &mu, const std::vector<Tangent<T>> &p,
                   bool uniform) {
    std::vector<NonAssociated<T>> nodes;
    nodes.reserve(mu.size());
    for (std::size_t i = 0; i < mu.size(); ++i)
        nodes.push_back(detail::checked<T>(mu[i], p[i]));
    const auto all = [&nodes](auto property) {
        return std::all_of(nodes.begin(), nodes.end(), property);
    };

    if (all([](const auto &node) { return node.mu(0) == 0.0; }))
        return Uniform<Frictionless>{};
    if constexpr (T > 1) {
        if (!all([](const auto &node) { return node.q_squared.minCoeff() == 1.0; }))
            return detail::collect<T>(nodes, uniform, [](const auto &node) { return node; });
        if (!all([](const auto &node) {
                return node.coefficient.minCoeff() == node.coefficient.maxCoeff();
            }))
            return detail::collect<T>(
                nodes, uniform, [](const auto &node) { return Associated<T>{node.coefficient}; });
    }
    return detail::collect<T>(nodes, uniform,
                              [](const auto &node) { return Isotropic<T>{node.mu(0)}; });
}
} // namespace dolfinx_contact
