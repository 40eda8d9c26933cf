// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_blocks.h
/// The scaled W with a block of each contact: the matrix of methods in which no contact is rigid or
/// open.
#pragma once

#include "condensed_linear.h"
#include "condensed_system.h"

namespace dolfinx_contact::condensed {
/// Factors of W B + A, where A and B have a block for each contact.
template <int T> class BlockSolver {
  public:
    static constexpr int D = T + 1;
    using Block = Eigen::Matrix<double, D, D>;
    using Blocks = std::vector<Block>; // of the contacts

    explicit BlockSolver(const System<T> &system)
        : system_(system), dense_(system.pattern == nullptr) {}

    /// False if the matrix is singular. Without B it is I.
    bool factor(const Blocks &A, const Blocks *B = nullptr) {
        const auto n = static_cast<std::size_t>(system_.nodes);
        if (dense_) {
            MatrixXd J =
                system_.left.asDiagonal() * system_.W->dense() * system_.right.asDiagonal();
            for (std::size_t j = 0; j < n; ++j) {
                const Index first = D * static_cast<Index>(j);
                if (B != nullptr)
                    J.middleCols<D>(first) = (J.middleCols<D>(first) * (*B)[j]).eval();
                J.block<D, D>(first, first) += A[j];
            }
            linear_.factor(J);
            return true;
        }
        std::vector<Eigen::Triplet<double>> entries;
        for (std::size_t j = 0; j < n; ++j)
            for (const Index i : (*system_.pattern)[j]) {
                const Index row = D * i, column = D * static_cast<Index>(j);
                Block block;
                for (int k = 0; k < D; ++k)
                    for (int l = 0; l < D; ++l)
                        block(k, l) = system_.left[row + k] * (*system_.W)(row + k, column + l) *
                                      system_.right[column + l];
                if (B != nullptr)
                    block *= (*B)[j];
                if (row == column)
                    block += A[j];
                for (int k = 0; k < D; ++k)
                    for (int l = 0; l < D; ++l)
                        entries.emplace_back(row + k, column + l, block(k, l));
            }
        Eigen::SparseMatrix<double> J(system_.size(), system_.size());
        J.setFromTriplets(entries.begin(), entries.end());
        const bool regular = linear_.factor(J);
        dense_ = linear_.filled();
        return regular;
    }

    VectorXd solve(const VectorXd &rhs) const { return linear_.again(rhs); }

  private:
    const System<T> &system_;
    LinearSolver linear_;
    bool dense_; // factors would be
};
} // namespace dolfinx_contact::condensed
