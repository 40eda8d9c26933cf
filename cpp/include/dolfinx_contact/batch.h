// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file batch.h
/// A function of one node over all nodes of a contact: strided arrays in, strided arrays out.
///
/// Nodes are taken in blocks: components are gathered into contiguous columns and rotated to the
/// principal axes, the function is evaluated along the columns, results are rotated back and
/// scattered. So the loop along the columns vectorises whatever the layout of the arrays, and
/// outputs may overwrite inputs. No allocation, no exception, no thread.
#pragma once

#include "law.h"
#include "maps.h"

namespace dolfinx_contact {
/// Component j of node i is data[i * row + j * column]. Without data: an array that is not there.
template <class Scalar> struct View {
    Scalar *data = nullptr;
    std::ptrdiff_t row = 0, column = 0;

    View from_node(std::size_t node) const {
        return {data == nullptr ? data : data + static_cast<std::ptrdiff_t>(node) * row, row,
                column};
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
    View<double> value{};        ///< scalar, or vector
    View<std::uint8_t> branch{}; ///< scalar, number of the enum
    View<double> by_reaction{};  ///< (tangents + 1)^2 components, row by row
    View<double> by_motion{};    ///< likewise
};

namespace detail {
inline constexpr int block_size = 64;

/// One component at the nodes of a block.
using Column = double[block_size];

template <class Scalar, class To>
void gather(const View<const Scalar> &view, int component, int count, To &to) {
    if (view.data == nullptr)
        return;
    const Scalar *from = view.data + component * view.column;
    if (view.row == 1)
        std::copy_n(from, count, to);
    else
        for (int i = 0; i < count; ++i)
            to[i] = from[i * view.row];
}

template <class Scalar>
void scatter(const Column &from, int count, const View<Scalar> &view, int component) {
    if (view.data == nullptr)
        return;
    Scalar *to = view.data + component * view.column;
    if (view.row == 1)
        for (int i = 0; i < count; ++i)
            to[i] = static_cast<Scalar>(from[i]);
    else
        for (int i = 0; i < count; ++i)
            to[i * view.row] = static_cast<Scalar>(from[i]);
}

/// Columns of a block for T tangential components, D = T + 1 in all.
template <int T> struct Block {
    static constexpr int D = T + 1;
    Column r[D]{}, gap{}, slip[D]{}, rho_n{}, rho_t{}, cos{}, sin{}; // slip[T] is not used
    std::uint8_t branch_in[block_size]{};
    Column value[D], branch, p[D], scale, by_reaction[D * D], by_motion[D * D];

    void load(const Inputs &in, std::size_t first, int count) {
        const auto r_in = in.r.from_node(first), slip_in = in.slip.from_node(first);
        for (int k = 0; k < T; ++k) {
            gather(r_in, k, count, r[k]);
            gather(slip_in, k, count, slip[k]);
        }
        gather(r_in, in.tangents, count, r[T]);
        gather(in.gap.from_node(first), 0, count, gap);
        gather(in.rho_n.from_node(first), 0, count, rho_n);
        gather(in.rho_t.from_node(first), 0, count, rho_t);
        gather(in.branch.from_node(first), 0, count, branch_in);
        if constexpr (T == 2)
            if (in.axes.data != nullptr) {
                gather(in.axes.from_node(first), 0, count, cos);
                gather(in.axes.from_node(first), 1, count, sin);
                rotate(r[0], r[1], 1.0, count);
                rotate(slip[0], slip[1], 1.0, count);
            }
    }

    [[gnu::always_inline]] State<T> state(int i) const {
        State<T> s;
        for (int k = 0; k < T; ++k) {
            s.r[k] = r[k][i];
            s.slip[k] = slip[k][i];
        }
        s.r[T] = r[T][i];
        s.gap = gap[i];
        s.rho_n = rho_n[i];
        s.rho_t = rho_t[i];
        s.branch = static_cast<Branch>(branch_in[i]);
        return s;
    }

    [[gnu::always_inline]] void keep(double result, int i) { value[0][i] = result; }

    [[gnu::always_inline]] void keep(const CodedReaction<T> &result, int i) {
        for (int k = 0; k < D; ++k)
            value[k][i] = result.r[k];
        branch[i] = result.branch;
    }

    void keep(const Reaction<T> &result, int i) {
        keep(CodedReaction<T>{result.r, static_cast<double>(result.branch)}, i);
    }

    [[gnu::always_inline]] void keep(const Start<T> &start, int i) {
        keep(CodedReaction<T>{start.r, start.branch}, i);
        for (int k = 0; k < D; ++k)
            p[k][i] = start.p[k];
        scale[i] = start.scale;
    }

    void keep(const Linearisation<T> &result, int i) {
        keep(result.value, i);
        for (int a = 0; a < D; ++a)
            for (int b = 0; b < D; ++b) {
                by_reaction[a * D + b][i] = result.by_reaction(a, b);
                by_motion[a * D + b][i] = result.by_motion(a, b);
            }
    }

    /// (x, y) <- (c x + s y, c y - s x): to the principal axes; with sign = -1 from them.
    void rotate(Column &x, Column &y, double sign, int count) const {
        for (int i = 0; i < count; ++i) {
            const double s = sign * sin[i], turned = cos[i] * x[i] + s * y[i];
            y[i] = cos[i] * y[i] - s * x[i];
            x[i] = turned;
        }
    }

    /// J <- R^T J R, row by row: of every column, then of every row, the two tangential entries.
    void rotate_matrix_back(Column (&J)[D * D], int count) const {
        for (int k = 0; k < D; ++k)
            rotate(J[k], J[D + k], -1.0, count);
        for (int k = 0; k < D * D; k += D)
            rotate(J[k], J[k + 1], -1.0, count);
    }

    template <class Result> void rotate_back(int count) {
        if constexpr (T == 2 && !std::is_same_v<Result, double>)
            rotate(value[0], value[1], -1.0, count);
        if constexpr (T == 2 && std::is_same_v<Result, Linearisation<T>>) {
            rotate_matrix_back(by_reaction, count);
            rotate_matrix_back(by_motion, count);
        }
    }

    template <class Result>
    void store(const Outputs &out, int tangents, std::size_t first, int count) const {
        const auto value_out = out.value.from_node(first);
        if constexpr (std::is_same_v<Result, double>)
            return scatter(value[0], count, value_out, 0);
        for (int k = 0; k < T; ++k)
            scatter(value[k], count, value_out, k);
        scatter(value[T], count, value_out, tangents);
        scatter(branch, count, out.branch.from_node(first), 0);
        if constexpr (std::is_same_v<Result, Linearisation<T>>)
            for (int k = 0; k < D * D; ++k) {
                // the last component is the normal one for any number of tangential ones
                const int component = (tangents + 1) * (tangents + 1) - D * D + k;
                scatter(by_reaction[k], count, out.by_reaction.from_node(first), component);
                scatter(by_motion[k], count, out.by_motion.from_node(first), component);
            }
    }
};

/// Solves the equations of the unfinished nodes of a block, some at a time.
template <class Source, class F, int T>
void finish(const Source &source, F f, std::size_t first, int size, Block<T> &block) {
    const auto law = [&](int i) { return source(first + static_cast<std::size_t>(i)); };
    const auto p = [&](int i) {
        Local<T> v;
        for (int k = 0; k <= T; ++k)
            v[k] = block.p[k][i];
        return v;
    };
    const auto equation = [&](int i) { return f.equation(law(i), p(i)); };
    const auto keep = [&](int i, const SecularRoot<T> &root) {
        block.keep(CodedReaction<T>{f.point(law(i), p(i), block.scale[i], root), 2.0}, i);
    };
    int nodes[block_size], count = 0;
    for (int i = 0; i < size; ++i) {
        nodes[count] = i;
        count += block.branch[i] == unfinished ? 1 : 0;
    }
    if constexpr (is_isotropic<typename Source::Law>) {
        for (int l = 0; l < count; ++l)
            keep(nodes[l], root_for(law(nodes[l]), equation(nodes[l])));
    } else {
        constexpr int lanes = 16;
        SecularEquations<T, lanes> equations;
        for (int done = 0; done < count; done += lanes) {
            const int together = std::min(lanes, count - done);
            for (int l = 0; l < together; ++l)
                equations.set(l, equation(nodes[done + l]));
            equations.solve(together);
            for (int l = 0; l < together; ++l)
                keep(nodes[done + l], equations.root(l));
        }
    }
}
} // namespace detail

/// out = f(law of node i, State of node i) for all nodes i < count, where f is one of maps.h or
/// alike. Nothing in the loop asks which law it is: visit an AnyLaw around the call.
template <class Source, class F>
void for_each_node(const Source &source, std::size_t count, const Inputs &in, const Outputs &out,
                   F f) {
    constexpr int T = Source::Law::tangents;
    using Result = decltype(f(source(0), State<T>{}));
    detail::Block<T> block;
    for (std::size_t first = 0; first < count; first += detail::block_size) {
        const int size = static_cast<int>(std::min<std::size_t>(detail::block_size, count - first));
        block.load(in, first, size);
        for (int i = 0; i < size; ++i)
            block.keep(f(source(first + static_cast<std::size_t>(i)), block.state(i)), i);
        if constexpr (T > 0 && std::is_same_v<Result, Start<T>>)
            detail::finish(source, f, first, size, block);
        if (in.axes.data != nullptr)
            block.template rotate_back<Result>(size);
        block.template store<Result>(out, in.tangents, first, size);
    }
}
} // namespace dolfinx_contact
