// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_sparse.h
/// Factors of a sparse matrix by levels, which take the least time if there are few entries more,
/// or by Eigen's SparseLU, which has all pivots to choose from.
#pragma once

#include "condensed_levels.h"
#include <cmath>
#include <optional>

namespace dolfinx_contact::condensed {
class SparseSolver {
  public:
    SparseSolver() {
        constexpr double enough = 1e-2; // of the largest entry of a column: pivots that fill less
        lu_.setPivotThreshold(enough);
    }

    /// False if J, compressed, is singular. The order of unknowns is that of the last matrix, if
    /// that had entries in the same places.
    bool factor(const Sparse &J) {
        if (!known(J)) {
            levels_.emplace(J);
            ordered_ = false;
        }
        by_levels_ = levels_pay(J) && factors_.factor(J, *levels_, is_symmetric(J)) && accurate(J);
        if (by_levels_)
            return true;
        if (!ordered_)
            lu_.analyzePattern(J);
        ordered_ = true;
        lu_.factorize(J);
        return lu_.info() == Eigen::Success;
    }
    void solve(const VectorView &rhs, VectorResult y) const {
        if (by_levels_)
            factors_.solve(rhs, y);
        else
            y = lu_.solve(rhs);
    }

    /// The entries of the factors over those of dense ones; zero if there are none.
    double fill() const {
        if (places_.empty())
            return 0.0;
        const auto n = static_cast<double>(places_.front());
        const double entries =
            by_levels_ ? levels_->entries() : static_cast<double>(lu_.nnzL() + lu_.nnzU());
        return entries / (n * n);
    }

  private:
    /// Whether J has as many rows as the last matrix and entries in the same places; keeps those.
    bool known(const Sparse &J) {
        const int *outer = J.outerIndexPtr(), *inner = J.innerIndexPtr();
        std::vector<int> places{static_cast<int>(J.rows())};
        places.insert(places.end(), outer, outer + J.outerSize() + 1);
        places.insert(places.end(), inner, inner + J.nonZeros());
        const bool same = places == places_;
        places_ = std::move(places);
        return same;
    }
    /// Measured on piles: about so many times the entries of J is where both take as long.
    bool levels_pay(const Sparse &J) const {
        constexpr double most = 16.0;
        return levels_->entries() <= most * static_cast<double>(J.nonZeros());
    }
    /// But for rounding, as left by scales of rows and columns.
    static bool is_symmetric(const Sparse &J) {
        constexpr double rounding = 1e-14;
        const Sparse transposed = J.transpose();
        const VectorXd size = J.diagonal().cwiseAbs().cwiseSqrt();
        for (Index j = 0; j < J.cols(); ++j) {
            Sparse::InnerIterator other(transposed, j);
            for (Sparse::InnerIterator it(J, j); it; ++it, ++other)
                if (!other || other.row() != it.row() ||
                    !(std::abs(it.value() - other.value()) <= rounding * size[j] * size[it.row()]))
                    return false;
        }
        return true;
    }
    /// Whether factors with pivots of levels alone solve for one vector.
    bool accurate(const Sparse &J) const {
        constexpr double enough = 1e-10;
        const VectorXd b = VectorXd::LinSpaced(J.rows(), 1.0, 2.0);
        VectorXd x(J.rows());
        factors_.solve(view(b), result(x));
        const VectorXd left = b - J * x, size = J.cwiseAbs() * x.cwiseAbs() + b;
        return left.norm() <= enough * size.norm();
    }

    std::vector<int> places_;
    std::optional<Levels> levels_;
    LevelFactors factors_;
    Eigen::SparseLU<Sparse> lu_;
    bool by_levels_ = false, ordered_ = false; // the last factors; lu_, for the places
};
} // namespace dolfinx_contact::condensed
