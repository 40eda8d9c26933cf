// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_sweeps.h
/// Block Gauss-Seidel with exact nodal solves: it needs no factors and no rank, and finds its way
/// where contacts are many and chains of them short. A start for Newton's method.
#pragma once

#include "condensed_newton.h"
#include "condensed_nodal.h"
#include <numeric>

namespace dolfinx_contact::condensed {
/// Blocks of a scaled W that are not zero, row by row.
template <int T> struct Couplings {
    static constexpr int D = T + 1;
    using Matrix = Eigen::Matrix<double, D, D>;
    struct Coupling {
        Index node;
        Matrix block;
    };
    std::vector<std::vector<Coupling>> rows;

    explicit Couplings(const System<T> &system) : rows(static_cast<std::size_t>(system.nodes)) {
        for (Index i = 0; i < system.nodes; ++i)
            for (const Index j : neighbours(system, i)) {
                Matrix block;
                for (int k = 0; k < D; ++k)
                    for (int l = 0; l < D; ++l)
                        block(k, l) = (*system.W)(D * i + k, D * j + l);
                if (block.isZero(0.0) && i != j)
                    continue;
                if (i == j)
                    block.diagonal().array() += system.shift;
                block = system.left.template segment<D>(D * i).asDiagonal() * block *
                        system.right.template segment<D>(D * j).asDiagonal();
                rows[static_cast<std::size_t>(i)].push_back({j, block});
            }
    }

  private:
    /// Contacts that may move i: the pattern is by columns, but that of a symmetric matrix.
    static std::vector<Index> neighbours(const System<T> &system, Index i) {
        if (system.pattern != nullptr)
            return (*system.pattern)[static_cast<std::size_t>(i)];
        std::vector<Index> all(static_cast<std::size_t>(system.nodes));
        std::iota(all.begin(), all.end(), Index{0});
        return all;
    }
};

/// Sweeps, forward and backward in turn, until they change r by less than `target` of it or for
/// `max_sweeps`. A sweep counts as one iteration.
template <int T>
void sweep(const System<T> &system, VectorXd &r, double target, int max_sweeps, Budget &budget) {
    constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;
    if (system.tied > 0)
        return;
    const Couplings<T> couplings(system);
    std::vector<Nodal<T>> nodal;
    for (Index i = 0; i < system.nodes; ++i)
        for (const auto &[j, block] : couplings.rows[static_cast<std::size_t>(i)])
            if (j == i) {
                if (!(block(T, T) > 0.0))
                    return;
                nodal.emplace_back(block, system.smooth[static_cast<std::size_t>(i)]);
            }
    const VectorXd free = system.left.cwiseProduct(system.q);
    for (int k = 0; k < max_sweeps && !budget.spent(); ++k, ++budget.iterations) {
        double change = 0.0, size = 0.0;
        for (Index c = 0; c < system.nodes; ++c) {
            const Index i = k % 2 == 0 ? c : system.nodes - 1 - c;
            Node q = free.segment<D>(D * i);
            for (const auto &[j, block] : couplings.rows[static_cast<std::size_t>(i)])
                if (j != i)
                    q += block * r.segment<D>(D * j);
            const Node before = r.segment<D>(D * i);
            Node after = before;
            nodal[static_cast<std::size_t>(i)].solve(q, after);
            r.segment<D>(D * i) = after;
            change += (after - before).squaredNorm();
            size += after.squaredNorm();
        }
        budget.tell(system, r);
        if (!(change > target * target * size))
            return;
    }
}
} // namespace dolfinx_contact::condensed
