// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_sweeps.h
/// Block Gauss-Seidel with exact nodal solves: it needs no factors and no rank, and finds its way
/// where contacts are many and chains of them short. A start for Newton's method.
#pragma once

#include "condensed_newton.h"
#include "condensed_nodal.h"
#include <algorithm>
#include <numeric>
#include <optional>
#include <random>

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
        for (Index j = 0; j < system.nodes; ++j) {
            if (system.pattern != nullptr) {
                const auto &contacts = system.pattern->moved_by(j);
                for (std::size_t a = 0; a < contacts.size(); ++a)
                    add(system, contacts[a], j,
                        system.pattern->template block<D>(j, static_cast<Index>(a)));
                continue;
            }
            for (Index i = 0; i < system.nodes; ++i) {
                Matrix block;
                for (int k = 0; k < D; ++k)
                    for (int l = 0; l < D; ++l)
                        block(k, l) = (*system.W)(D * i + k, D * j + l);
                add(system, i, j, block);
            }
        }
    }

  private:
    void add(const System<T> &system, Index i, Index j, Matrix block) {
        if (block.isZero(0.0) && i != j)
            return;
        if (i == j)
            block.diagonal().array() += system.shift;
        block = system.left.template segment<D>(D * i).asDiagonal() * block *
                system.right.template segment<D>(D * j).asDiagonal();
        rows[static_cast<std::size_t>(i)].push_back({j, block});
    }
};

/// Sweeps over the contacts of a System, each contact solved for what the others give.
template <int T> class Sweeps {
  public:
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;

    explicit Sweeps(const System<T> &system)
        : system_(system), free_(system.left.cwiseProduct(system.q)) {
        if (!applies())
            return;
        couplings_.emplace(system);
        order_.resize(static_cast<std::size_t>(system.nodes));
        std::iota(order_.begin(), order_.end(), Index{0});
        for (const Index i : order_)
            for (const auto &[j, block] : couplings_->rows[static_cast<std::size_t>(i)])
                if (j == i)
                    nodal_.emplace_back(block, system.smooth[static_cast<std::size_t>(i)]);
    }

    /// Until they change r by less than `target` of it, which is returned, or for `max_sweeps`:
    /// forward and backward in turn, or in an order of chance. A sweep counts as one iteration.
    /// True at once where sweeps do not apply: none changes r.
    bool run(VectorXd &r, double target, int max_sweeps, Budget &budget,
             std::minstd_rand *random = nullptr) {
        if (!couplings_)
            return true;
        for (int k = 0; k < max_sweeps && !budget.spent(); ++k, ++budget.iterations) {
            if (random != nullptr)
                std::shuffle(order_.begin(), order_.end(), *random);
            double change = 0.0, size = 0.0;
            for (const Index i : order_) {
                const Node before = r.segment<D>(D * i);
                solve(i, r);
                change += (r.segment<D>(D * i) - before).squaredNorm();
                size += r.segment<D>(D * i).squaredNorm();
            }
            if (random == nullptr)
                std::reverse(order_.begin(), order_.end());
            budget.tell(system_, r);
            if (!(change > target * target * size))
                return true;
        }
        return false;
    }

  private:
    /// No rows but those of contacts, all of which give way.
    bool applies() const {
        for (Index i = 0; i < system_.nodes; ++i)
            if (!((*system_.W)(D * i + T, D * i + T) + system_.shift > 0.0))
                return false;
        return system_.tied == 0;
    }
    void solve(Index i, VectorXd &r) const {
        Node q = free_.segment<D>(D * i), found = r.segment<D>(D * i);
        for (const auto &[j, block] : couplings_->rows[static_cast<std::size_t>(i)])
            if (j != i)
                q += block * r.segment<D>(D * j);
        nodal_[static_cast<std::size_t>(i)].solve(q, found);
        r.segment<D>(D * i) = found;
    }

    const System<T> &system_;
    VectorXd free_;
    std::optional<Couplings<T>> couplings_;
    std::vector<Nodal<T>> nodal_;
    std::vector<Index> order_;
};
} // namespace dolfinx_contact::condensed
