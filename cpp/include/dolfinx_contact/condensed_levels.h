// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_levels.h
/// Factors of a sparse matrix by levels of its graph: in their order it is block tridiagonal, and
/// the blocks are dense.
#pragma once

#include "condensed_algebra.h"
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace dolfinx_contact::condensed {
/// The unknowns of a sparse matrix by their distance from a first one, part by part where it falls
/// into several. Those of a level have entries with their own and the two next to it alone, if
/// entries are in symmetric places.
class Levels {
  public:
    struct Place {
        std::size_t level;
        Index within;
    };

    explicit Levels(const Sparse &A) : place_(of(A.rows()), {none, 0}) {
        for (int i = 0; i < A.rows(); ++i)
            if (place_[of(i)].level == none)
                add(longest_from(A, i));
    }
    std::size_t count() const { return levels_.size(); }
    const std::vector<int> &at(std::size_t k) const { return levels_[k]; }
    Index size(std::size_t k) const { return static_cast<Index>(levels_[k].size()); }
    Place place(Index i) const { return place_[of(i)]; }
    /// Of the factors of a matrix, both of them.
    double entries() const {
        double sum = 0.0;
        for (std::size_t k = 0; k < count(); ++k)
            sum += static_cast<double>(size(k) * (size(k) + (k > 0 ? 2 * size(k - 1) : 0)));
        return sum;
    }

  private:
    static constexpr std::size_t none = std::numeric_limits<std::size_t>::max(), seen = none - 1;
    using Found = std::vector<std::vector<int>>;

    static std::size_t of(Index i) { return static_cast<std::size_t>(i); }
    /// From an unknown as far from others as repeated searches find
    /// [A. George, J. W. H. Liu, ACM Trans. Math. Softw. 5 (1979)].
    Found longest_from(const Sparse &A, int first) {
        const auto entries = [&](int i) { return A.outerIndexPtr()[i + 1] - A.outerIndexPtr()[i]; };
        const auto fewer = [&](int i, int j) { return entries(i) < entries(j); };
        for (Found found = search(A, first);;) {
            const std::vector<int> &last = found.back();
            Found other = search(A, *std::min_element(last.begin(), last.end(), fewer));
            if (other.size() <= found.size())
                return found;
            found = std::move(other);
        }
    }
    Found search(const Sparse &A, int first) {
        Found found{{first}};
        place_[of(first)].level = seen;
        for (std::vector<int> next; true; found.push_back(std::exchange(next, {}))) {
            for (const int j : found.back())
                for (Sparse::InnerIterator it(A, j); it; ++it)
                    if (auto &level = place_[of(it.row())].level; level == none) {
                        level = seen;
                        next.push_back(static_cast<int>(it.row()));
                    }
            if (next.empty())
                break;
        }
        for (const auto &level : found)
            for (const int i : level)
                place_[of(i)].level = none;
        return found;
    }
    void add(Found &&found) {
        for (auto &level : found) {
            for (std::size_t a = 0; a < level.size(); ++a)
                place_[of(level[a])] = {levels_.size(), static_cast<Index>(a)};
            levels_.push_back(std::move(level));
        }
    }

    std::vector<Place> place_;
    Found levels_;
};

/// A = L U with D_k on the diagonal of the levels, A_k right of it and B_k below:
/// F_k G_k = D_k - B'_(k-1) A'_(k-1), A'_k = F_k^-1 A_k, B'_k = B_k G_k^-1. Most of the time is
/// that of matrix products. Pivots are chosen within levels alone; a symmetric positive definite A
/// needs none, and is L L'.
class LevelFactors {
  public:
    /// False if A has entries between other levels, or is symmetric and not positive definite.
    bool factor(const Sparse &A, const Levels &levels, bool symmetric) {
        levels_ = &levels;
        symmetric_ = symmetric;
        if (!gather(A))
            return false;
        for (std::size_t k = 0; k < diagonal_.size(); ++k)
            if (!symmetric)
                factor(k);
            else if (!factor_symmetric(k))
                return false;
        return true;
    }

    void solve(const VectorView &b, VectorResult x) const {
        const std::size_t count = diagonal_.size();
        std::vector<VectorXd> parts(count);
        for (std::size_t k = 0; k < count; ++k) {
            VectorXd &part = parts[k];
            part = b(levels_->at(k));
            if (k > 0 && symmetric_)
                part.noalias() -= right_[k - 1].transpose() * parts[k - 1];
            else if (k > 0)
                part.noalias() -= below_[k - 1] * parts[k - 1];
            if (symmetric_) {
                diagonal_[k].triangularView<Eigen::Lower>().solveInPlace(part);
            } else {
                part = (order_[k] * part).eval();
                diagonal_[k].triangularView<Eigen::UnitLower>().solveInPlace(part);
            }
        }
        for (std::size_t k = count; k-- > 0;) {
            VectorXd &part = parts[k];
            if (k + 1 < count)
                part.noalias() -= right_[k] * parts[k + 1];
            if (symmetric_)
                diagonal_[k].transpose().triangularView<Eigen::Upper>().solveInPlace(part);
            else
                diagonal_[k].triangularView<Eigen::Upper>().solveInPlace(part);
            x(levels_->at(k)) = part;
        }
    }

  private:
    bool factor_symmetric(std::size_t k) {
        MatrixXd &D = diagonal_[k];
        if (k > 0)
            D.selfadjointView<Eigen::Lower>().rankUpdate(right_[k - 1].transpose(), -1.0);
        if (Eigen::LLT<Eigen::Ref<MatrixXd>>(D).info() != Eigen::Success)
            return false;
        if (right_[k].size() > 0)
            D.triangularView<Eigen::Lower>().solveInPlace(right_[k]);
        return true;
    }
    void factor(std::size_t k) {
        MatrixXd &D = diagonal_[k], &right = right_[k];
        if (k > 0)
            D.noalias() -= below_[k - 1] * right_[k - 1];
        order_[k] = Eigen::PartialPivLU<Eigen::Ref<MatrixXd>>(D).permutationP();
        if (right.size() > 0) {
            right = (order_[k] * right).eval();
            D.triangularView<Eigen::UnitLower>().solveInPlace(right);
            D.triangularView<Eigen::Upper>().solveInPlace<Eigen::OnTheRight>(below_[k]);
        }
    }
    bool gather(const Sparse &A) {
        const std::size_t count = levels_->count();
        diagonal_.resize(count);
        right_.resize(count);
        below_.resize(count);
        order_.resize(count);
        for (std::size_t k = 0; k < count; ++k) {
            const Index size = levels_->size(k), next = k + 1 < count ? levels_->size(k + 1) : 0;
            diagonal_[k].setZero(size, size);
            right_[k].setZero(size, next);
            if (!symmetric_)
                below_[k].setZero(next, size);
        }
        for (Index j = 0; j < A.cols(); ++j) {
            const auto [column, b] = levels_->place(j);
            for (Sparse::InnerIterator it(A, j); it; ++it) {
                const auto [row, a] = levels_->place(it.row());
                if (row == column)
                    diagonal_[row](a, b) = it.value();
                else if (row + 1 == column)
                    right_[row](a, b) = it.value();
                else if (row != column + 1)
                    return false;
                else if (!symmetric_)
                    below_[column](a, b) = it.value();
            }
        }
        return true;
    }

    const Levels *levels_ = nullptr;
    bool symmetric_ = false;
    std::vector<MatrixXd> diagonal_, right_, below_; // F_k and G_k, A'_k, B'_k
    std::vector<Eigen::PartialPivLU<MatrixXd>::PermutationType> order_;
};
} // namespace dolfinx_contact::condensed
