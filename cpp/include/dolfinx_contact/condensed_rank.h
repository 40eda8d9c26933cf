// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_rank.h
/// A W of low rank as a product: contacts of rigid bodies have more rows than these have motions.
#pragma once

#include "condensed_matrix.h"
#include <algorithm>
#include <numeric>
#include <optional>

namespace dolfinx_contact::condensed {
/// W = C X with r columns C of W, their zeros left out, and r rows X.
struct Product {
    Eigen::SparseMatrix<double> C;
    MatrixXd X;
};

/// W = L U' but for what is left, by elimination with large pivots of what is left of the diagonal,
/// of matrices that are symmetric and positive semidefinite but for a little.
class Elimination {
  public:
    explicit Elimination(const Square &W)
        : algebra_(W.algebra()), symmetric_(W.symmetric()), left_(W.diagonal()) {
        if (W.sparse() != nullptr) {
            columns_ = *W.sparse();
            if (!symmetric_)
                rows_ = columns_.transpose();
        } else {
            A_ = W.dense();
        }
    }

    /// Until a part `smallest` of the largest diagonal entry is left; false if that takes more than
    /// `most` columns. Panels of columns are brought up to date at once, for the speed of matrix
    /// products; pivots are taken from a panel while it has large ones.
    bool run(double smallest, Index most) {
        constexpr double large = 0.1; // of the largest of all
        const double end = smallest * (left_.size() > 0 ? left_.maxCoeff() : 0.0);
        L_.resize(left_.size(), most);
        U_.resize(left_.size(), most);
        while (left_.size() > 0 && left_.maxCoeff() > end) {
            const std::vector<Index> panel = largest_left();
            const MatrixXd columns = brought(columns_at(panel), L_, U_, panel);
            const MatrixXd rows = symmetric_ ? columns : brought(rows_at(panel), U_, L_, panel);
            const Index first = rank();
            for (Index a = 0; left_[panel[of(a)]] > std::max(end, large * left_.maxCoeff());) {
                if (rank() == most)
                    return false;
                eliminate(panel[of(a)], columns.col(a), rows.col(a), first);
                left_(panel).maxCoeff(&a);
            }
        }
        return true;
    }
    Index rank() const { return static_cast<Index>(pivots_.size()); }

    /// W = C X.
    Product product() const {
        const auto U = U_.leftCols(rank());
        const MatrixXd corner = U(pivots_, Eigen::seqN(0, rank())).transpose();
        MatrixXd X = U.transpose();
        algebra_.solve_triangular(view(corner), result(X));
        return {columns_at(pivots_).sparseView(), X};
    }

  private:
    static std::size_t of(Index i) { return static_cast<std::size_t>(i); }

    MatrixXd columns_at(const std::vector<Index> &at) const {
        if (A_.size() == 0)
            return gathered(columns_, at);
        return A_(Eigen::seqN(Index{0}, A_.rows()), at);
    }
    /// Transposed.
    MatrixXd rows_at(const std::vector<Index> &at) const {
        if (A_.size() == 0)
            return gathered(rows_, at);
        return A_(at, Eigen::seqN(Index{0}, A_.rows())).transpose();
    }
    static MatrixXd gathered(const Sparse &A, const std::vector<Index> &at) {
        MatrixXd found = MatrixXd::Zero(A.rows(), static_cast<Index>(at.size()));
        for (std::size_t k = 0; k < at.size(); ++k)
            for (Sparse::InnerIterator it(A, at[k]); it; ++it)
                found(it.row(), static_cast<Index>(k)) = it.value();
        return found;
    }

    /// Rows of the largest entries of what is left, the largest first.
    std::vector<Index> largest_left() const {
        constexpr Index width = 64;
        std::vector<Index> rows(of(left_.size()));
        std::iota(rows.begin(), rows.end(), Index{0});
        const auto end = rows.begin() + std::min(width, left_.size());
        std::partial_sort(rows.begin(), end, rows.end(),
                          [this](Index i, Index j) { return left_[i] > left_[j]; });
        return {rows.begin(), end};
    }
    /// Columns of W - L U'.
    MatrixXd brought(MatrixXd columns, const MatrixXd &L, const MatrixXd &U,
                     const std::vector<Index> &at) const {
        const MatrixXd of_columns = U(at, Eigen::seqN(0, rank())).transpose();
        algebra_.subtract_product(result(columns), view(L.leftCols(rank())), view(of_columns));
        return columns;
    }
    /// With p as pivot, its column and row up to date but for those since `first`.
    void eliminate(Index p, const VectorXd &column, const VectorXd &row, Index first) {
        const Index k = rank(), since = k - first;
        L_.col(k) =
            column - L_.middleCols(first, since) * U_.row(p).segment(first, since).transpose();
        if (symmetric_)
            U_.col(k) = L_.col(k);
        else
            U_.col(k) =
                row - U_.middleCols(first, since) * L_.row(p).segment(first, since).transpose();
        L_.col(k) /= L_(p, k);
        left_ -= L_.col(k).cwiseProduct(U_.col(k));
        left_[p] = 0.0;
        pivots_.push_back(p);
    }

    const LinearAlgebra &algebra_;
    MatrixXd A_;            // of W that is not sparse
    Sparse columns_, rows_; // of W that is; the rows if they are not the columns
    bool symmetric_;
    MatrixXd L_, U_;
    VectorXd left_; // of the diagonal
    std::vector<Index> pivots_;
};

/// W as a product, r its rank; none if that is more than `share` of its size. Whether the product
/// is W is asked of three vectors.
inline std::optional<Product> product(const Square &W, double share) {
    constexpr double smallest = 1e-11, accuracy = 1e-9;
    const Index n = W.size();
    Elimination elimination(W);
    if (!elimination.run(smallest, static_cast<Index>(share * static_cast<double>(n))) ||
        elimination.rank() == 0)
        return {};
    Product found = elimination.product();
    for (int sample = 1; sample <= 3; ++sample) {
        const VectorXd x =
            (sample * VectorXd::LinSpaced(n, 1.0, static_cast<double>(n))).array().sin();
        const VectorXd Wx = W * x;
        if (!((found.C * VectorXd(found.X * x) - Wx).norm() <= accuracy * Wx.norm()))
            return {};
    }
    return found;
}

/// The product of a matrix, found when it is first asked for.
class LazyProduct {
  public:
    explicit LazyProduct(const Square &W) : W_(W) {}
    /// Null if the rank is so large a part of the size that little is saved.
    const Product *get() const {
        constexpr double share = 0.6;
        if (!asked_)
            found_ = product(W_, share);
        asked_ = true;
        return found_ ? &*found_ : nullptr;
    }

  private:
    const Square &W_;
    mutable bool asked_ = false;
    mutable std::optional<Product> found_;
};
} // namespace dolfinx_contact::condensed
