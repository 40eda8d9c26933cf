// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file law.h
/// The law of a whole contact, its kind chosen once: one set of coefficients for all nodes, or one
/// per node.
#pragma once

#include "friction.h"
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
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

/// A law whose kind is known at run time. Visit it once per contact, not once per node.
template <int T>
using AnyLaw = std::conditional_t<
    T == 1, std::variant<Uniform<Frictionless<T>>, Uniform<Isotropic<T>>, Field<Isotropic<T>>>,
    std::variant<Uniform<Frictionless<T>>, Uniform<Isotropic<T>>, Field<Isotropic<T>>,
                 Uniform<Associated<T>>, Field<Associated<T>>, Uniform<NonAssociated<T>>,
                 Field<NonAssociated<T>>>>;

namespace detail {
inline void check(bool condition, const char *what, double value) {
    if (!condition)
        throw std::invalid_argument(std::string(what) + ", not " + std::to_string(value));
}

/// Coefficients of one node with p normalised: Q squared.
template <int T> NonAssociated<T> checked(const Tangent<T> &mu, const Tangent<T> &p) {
    NonAssociated<T> law{mu, Tangent<T>::Ones()};
    if (mu.isZero(0.0))
        return law;
    for (int i = 0; i < T; ++i) {
        check(mu[i] >= min_coefficient && mu[i] <= max_coefficient,
              "mu must be zero in all directions or between 1e-50 and 1e50 in all", mu[i]);
        check(p[i] > 0.0 && std::isfinite(p[i]), "p must be positive and finite", p[i]);
    }
    const Tangent<T> q = normalised_q<T>(mu, p);
    check(q.minCoeff() >= min_coefficient, "p/mu must not vary by more than 1e50, but is 1 and",
          q.minCoeff());
    // p proportional to mu up to rounding is the associated rule
    if (1.0 - q.minCoeff() > 4 * std::numeric_limits<double>::epsilon())
        law.q_squared = q.cwiseAbs2();
    return law;
}

/// The simplest law that has these coefficients, at one node or at as many as there are.
template <int T, class Make>
AnyLaw<T> simplest(const std::vector<NonAssociated<T>> &nodes, Make make) {
    const auto all = [&nodes](auto property) {
        return std::all_of(nodes.begin(), nodes.end(), property);
    };
    if constexpr (T > 1) {
        const bool associated = all([](const auto &n) { return n.q_squared.minCoeff() == 1.0; });
        if (!associated)
            return make([](const auto &n) { return n; });
        if (!all(
                [](const auto &n) { return n.coefficient.minCoeff() == n.coefficient.maxCoeff(); }))
            return make([](const auto &n) { return Associated<T>{n.coefficient}; });
    }
    return make([](const auto &n) { return Isotropic<T>{n.coefficient[0]}; });
}
} // namespace detail

/// The law with the coefficients mu and p of one node (uniform) or of each node: the simplest kind
/// that has them. Throws std::invalid_argument where mu or p is out of range.
template <int T>
AnyLaw<T> make_law(const std::vector<Tangent<T>> &mu, const std::vector<Tangent<T>> &p,
                   bool uniform) {
    std::vector<NonAssociated<T>> nodes;
    nodes.reserve(mu.size());
    for (std::size_t i = 0; i < mu.size(); ++i)
        nodes.push_back(detail::checked<T>(mu[i], p[i]));
    if (std::all_of(nodes.begin(), nodes.end(), [](const auto &n) { return n.mu(0) == 0.0; }))
        return Uniform<Frictionless<T>>{};
    const auto make = [&](auto convert) -> AnyLaw<T> {
        using Law = decltype(convert(nodes.front()));
        if (uniform)
            return Uniform<Law>{convert(nodes.front())};
        Field<Law> field;
        field.laws.reserve(nodes.size());
        std::transform(nodes.begin(), nodes.end(), std::back_inserter(field.laws), convert);
        return field;
    };
    return detail::simplest<T>(nodes, make);
}
} // namespace dolfinx_contact
