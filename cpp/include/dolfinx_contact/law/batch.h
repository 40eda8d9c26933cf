// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file batch.h
/// A function of one node over all nodes of a contact: strided arrays in, strided arrays out.
#pragma once

#include "law.h"
#include "maps.h"

namespace dolfinx_contact {
/// Component j of node i is data[i * row + j * column]. Without data: an array that is not there.
template <class Scalar> struct View {
    Scalar *data = nullptr;
    std::ptrdiff_t row = 0, column = 0;

    explicit operator bool() const { return data != nullptr; }
    Scalar &operator()(std::size_t node, int component = 0) const {
        return data[static_cast<std::ptrdiff_t>(node) * row + component * column];
    }
};

/// Arrays that a function may read; those it does not use need not be there. Vectors have
/// `tangents` tangential components and a normal one. A frictionless law reads normal components
/// alone.
struct Inputs {
    int tangents = 2;                  ///< 1 in two dimensions, 2 in three
    View<const double> r{};            ///< vector: reaction or other point
    View<const double> gap{};          ///< scalar
    View<const double> slip{};         ///< `tangents` components
    View<const double> rho_n{};        ///< scalar
    View<const double> rho_t{};        ///< scalar
    View<const std::uint8_t> branch{}; ///< scalar, number of the enum
    View<const double> axes{};         ///< principal direction x (cos, sin) in the tangent plane
};

/// Arrays that a function writes, where there. A frictionless law writes normal components alone.
struct Outputs {
    View<double> value{};        ///< scalar, vector, or its tangential components
    View<std::uint8_t> branch{}; ///< scalar, number of the enum
    View<double> by_reaction{};  ///< (tangents + 1)^2 components, row by row
    View<double> by_motion{};    ///< likewise
};

namespace detail {
template <int T> State<T> state(const Inputs &in, std::size_t node) {
    State<T> s{Local<T>::Zero(), 0.0, Tangent<T>::Zero(), 0.0, 0.0, Branch::open};
    for (int k = 0; k < T; ++k)
        s.r[k] = in.r(node, k);
    s.r[T] = in.r(node, in.tangents);
    if (in.gap)
        s.gap = in.gap(node);
    if (in.slip)
        for (int k = 0; k < T; ++k)
            s.slip[k] = in.slip(node, k);
    if (in.rho_n)
        s.rho_n = in.rho_n(node);
    if (in.rho_t)
        s.rho_t = in.rho_t(node);
    if (in.branch)
        s.branch = static_cast<Branch>(in.branch(node));
    return s;
}

template <int T>
void put_vector(const Local<T> &v, const View<double> &out, int tangents, std::size_t node) {
    if (!out)
        return;
    for (int k = 0; k < T; ++k)
        out(node, k) = v[k];
    out(node, tangents) = v[T];
}

template <int T>
void put_matrix(const Jacobian<T> &J, const View<double> &out, int tangents, std::size_t node) {
    if (!out)
        return;
    constexpr int D = T + 1;
    const int first = (tangents + 1) * (tangents + 1) - D * D; // the last entry is the normal one
    for (int a = 0; a < D; ++a)
        for (int b = 0; b < D; ++b)
            out(node, first + a * D + b) = J(a, b);
}

// What a function gives at one node, in the frame of its principal axes, into the arrays; R turns
// from the arrays' frame to that.

template <int T>
void store(double value, const Jacobian<T> &, const Outputs &out, int, std::size_t node) {
    out.value(node) = value;
}

template <int T>
void store(const Tangent<T> &along, const Jacobian<T> &R, const Outputs &out, int,
           std::size_t node) {
    const Tangent<T> v = R.template topLeftCorner<T, T>().transpose() * along;
    for (int k = 0; k < T; ++k)
        out.value(node, k) = v[k];
}

template <int T>
void store(const Reaction<T> &result, const Jacobian<T> &R, const Outputs &out, int tangents,
           std::size_t node) {
    put_vector<T>(R.transpose() * result.r, out.value, tangents, node);
    if (out.branch)
        out.branch(node) = static_cast<std::uint8_t>(result.branch);
}

template <int T>
void store(const Linearisation<T> &result, const Jacobian<T> &R, const Outputs &out, int tangents,
           std::size_t node) {
    store(result.value, R, out, tangents, node);
    put_matrix<T>(R.transpose() * result.by_reaction * R, out.by_reaction, tangents, node);
    put_matrix<T>(R.transpose() * result.by_motion * R, out.by_motion, tangents, node);
}
} // namespace detail

/// out = f(law of node i, State of node i) for all nodes i < count, where f is one of maps.h or
/// alike. Outputs may overwrite inputs. No allocation, no exception, no thread. Nothing in the loop
/// asks which law it is: visit an AnyLaw around the call.
template <class Source, class F>
void for_each_node(const Source &source, std::size_t count, const Inputs &in, const Outputs &out,
                   F f) {
    constexpr int T = Source::Law::tangents;
    Jacobian<T> R = Jacobian<T>::Identity();
    for (std::size_t node = 0; node < count; ++node) {
        State<T> state = detail::state<T>(in, node);
        if constexpr (T == 2)
            if (in.axes) {
                const double cos = in.axes(node, 0), sin = in.axes(node, 1);
                R.template topLeftCorner<2, 2>() << cos, sin, -sin, cos;
                state.r = (R * state.r).eval();
                state.slip = (R.template topLeftCorner<2, 2>() * state.slip).eval();
            }
        detail::store<T>(f(source(node), state), R, out, in.tangents, node);
    }
}
} // namespace dolfinx_contact
