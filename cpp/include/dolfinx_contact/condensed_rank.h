// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_rank.h
/// A W of low rank as a product: contacts of rigid bodies have more rows than these have motions.
#pragma once

#include "condensed_matrix.h"
#include <optional>

namespace dolfinx_contact::condensed {
/// W = C X with r columns C of W, their zeros left out, and r rows X.
struct Product {
    Eigen::SparseMatrix<double> C;
    MatrixXd X;
};

/// W as a product, r its rank; none if that is more than `share` of its size. By elimination with
/// the largest of what is left of the diagonal as pivot, for matrices that are symmetric and
/// positive semidefinite but for a little; whether the product is W is asked of three vectors.
inline std::optional<Product> product(const Square &W, double share) {
    constexpr double smallest = 1e-11, accuracy = 1e-9;
    const Index n = W.size(), most = static_cast<Index>(share * static_cast<double>(n));
    const MatrixXd A = W.dense();
    MatrixXd L(n, most), U(n, most); // A = L U', but for what is left
    VectorXd left = A.diagonal();
    const double largest = n > 0 ? left.maxCoeff() : 0.0;
    std::vector<Index> pivots;
    for (Index k = 0, p = 0; n > 0 && left.maxCoeff(&p) > smallest * largest; ++k) {
        if (k == most)
            return {};
        L.col(k) = A.col(p) - L.leftCols(k) * U.row(p).head(k).transpose();
        U.col(k) = A.row(p).transpose() - U.leftCols(k) * L.row(p).head(k).transpose();
        L.col(k) /= L(p, k);
        left -= L.col(k).cwiseProduct(U.col(k));
        left[p] = 0.0;
        pivots.push_back(p);
    }
    const auto r = static_cast<Index>(pivots.size());
    if (r == 0)
        return {};
    MatrixXd corner(r, r), columns(n, r);
    for (Index k = 0; k < r; ++k) {
        corner.col(k) = U.row(pivots[static_cast<std::size_t>(k)]).head(r).transpose();
        columns.col(k) = A.col(pivots[static_cast<std::size_t>(k)]);
    }
    Product found{columns.sparseView(),
                  corner.triangularView<Eigen::Upper>().solve(U.leftCols(r).transpose())};
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
