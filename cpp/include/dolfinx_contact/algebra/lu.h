// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file lu.h
/// LU factors with row pivots by halves of the columns [S. Toledo, SIAM J. Matrix Anal. Appl. 18
/// (1997)], which asks between its products whether to go on.
#pragma once

#include "../tuning.h"
#include "linear_algebra.h"
#include <vector>

namespace dolfinx_contact::condensed {
template <class Scalar> class LU {
  public:
    using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
    using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

    /// Of a square matrix.
    void compute(Matrix J, const Poll &poll) {
        factors_ = std::move(J);
        swaps_.assign(static_cast<std::size_t>(factors_.rows()), 0);
        if (factors_.rows() > 0)
            factor(factors_, swaps_.data(), poll);
    }
    Index rows() const { return factors_.rows(); }

    /// The smallest pivot over the largest one: nearly zero of a singular matrix.
    double pivots() const {
        if (rows() == 0)
            return 1.0;
        const auto sizes = factors_.diagonal().cwiseAbs();
        return static_cast<double>(sizes.minCoeff()) / static_cast<double>(sizes.maxCoeff());
    }

    Vector solve(Vector b) const {
        exchange(b, swaps_.data(), rows());
        factors_.template triangularView<Eigen::UnitLower>().solveInPlace(b);
        factors_.template triangularView<Eigen::Upper>().solveInPlace(b);
        return b;
    }

  private:
    using Block = Eigen::Ref<Matrix, 0, Eigen::OuterStride<>>;

    /// Rows i and swaps[i] of each column exchanged, in order.
    template <class Columns> static void exchange(Columns &&A, const Index *swaps, Index count) {
        for (Index j = 0; j < A.cols(); ++j)
            for (Index i = 0; i < count; ++i)
                std::swap(A(i, j), A(swaps[i], j));
    }

    /// Columns one after another.
    static void factor_few(Block A, Index *swaps) {
        for (Index j = 0; j < A.cols(); ++j) {
            const Index below = A.rows() - j - 1;
            A.col(j).tail(below + 1).cwiseAbs().maxCoeff(&swaps[j]);
            swaps[j] += j;
            A.row(j).swap(A.row(swaps[j]));
            if (A(j, j) == Scalar(0))
                continue;
            A.col(j).tail(below) /= A(j, j);
            for (Index k = j + 1; k < A.cols(); ++k)
                A.col(k).tail(below) -= A(j, k) * A.col(j).tail(below);
        }
    }

    // NOLINTNEXTLINE(misc-no-recursion): as deep as the logarithm of n
    static void factor(Block A, Index *swaps, const Poll &poll) {
        const Index rows = A.rows(), columns = A.cols(), half = columns / 2;
        if (columns <= Tuning::few_columns)
            return factor_few(A, swaps);
        factor(A.leftCols(half), swaps, poll);
        const Index chunk = std::max(Index{1}, Tuning::operations_between_polls / (rows * half));
        for (Index first = half; first < columns; first += chunk) {
            auto right = A.middleCols(first, std::min(chunk, columns - first));
            exchange(right, swaps, half);
            auto top = right.topRows(half);
            A.topLeftCorner(half, half)
                .template triangularView<Eigen::UnitLower>()
                .solveInPlace(top);
            right.bottomRows(rows - half).noalias() -= A.bottomLeftCorner(rows - half, half) * top;
            if (poll)
                poll();
        }
        factor(A.bottomRightCorner(rows - half, columns - half), swaps + half, poll);
        exchange(A.bottomLeftCorner(rows - half, half), swaps + half, columns - half);
        for (Index i = half; i < columns; ++i)
            swaps[i] += half;
    }

    Matrix factors_;
    std::vector<Index> swaps_;
};
} // namespace dolfinx_contact::condensed
