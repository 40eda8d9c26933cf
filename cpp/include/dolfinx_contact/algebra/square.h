// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file square.h
/// W and its inverse: a symmetric pair shares one array, a triangle each.
#pragma once

#include "linear_algebra.h"
#include <cmath>
#include <vector>

namespace dolfinx_contact::condensed {
using Real = long double; ///< of the judge; where it is no more than double, so much the worse
using VectorXl = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

/// Times a power of two, which loses no digit, in two factors: one alone may be out of range.
class Power {
  public:
    explicit Power(int exponent)
        : half_(std::ldexp(1.0, exponent / 2)), rest_(std::ldexp(1.0, exponent - exponent / 2)) {}

    double operator()(double x) const { return x * half_ * rest_; }
    template <class Matrix> auto operator()(const Eigen::MatrixBase<Matrix> &A) const {
        return A * half_ * rest_;
    }
    /// The exponent that brings the largest magnitude to between a half and one; zero for zeros.
    template <class Matrix> static int to_one(const Eigen::DenseBase<Matrix> &A) {
        const double largest = A.size() > 0 ? A.derived().cwiseAbs().maxCoeff() : 0.0;
        int exponent = 0;
        if (std::isfinite(largest))
            std::frexp(largest, &exponent);
        return -exponent;
    }

  private:
    double half_, rest_;
};

/// A square matrix of which all or, if it is symmetric, one triangle is stored; a view.
class Square {
  public:
    Square(const double *values, Index size, Index stride, Part part,
           const LinearAlgebra &algebra = linear_algebra())
        : values_(values, size, size, Eigen::OuterStride<>(stride)), part_(part),
          algebra_(&algebra) {}

    Index size() const { return values_.rows(); }
    bool symmetric() const { return part_ != Part::all; }
    const LinearAlgebra &algebra() const { return *algebra_; }
    VectorXd diagonal() const { return values_.diagonal(); }

    VectorXd operator*(const VectorXd &x) const {
        if (x.isZero(0.0))
            return VectorXd::Zero(size());
        VectorXd y(size());
        algebra_->multiply(values_, part_, view(x), result(y));
        return y;
    }

    /// |A| |x|: the size of what is added up in a product.
    VectorXd magnitudes(const VectorXd &x) const {
        if (x.isZero(0.0))
            return VectorXd::Zero(size());
        VectorXd y(size());
        algebra_->magnitudes(values_, part_, view(x), result(y));
        return y;
    }

    /// b + A x in twice the precision; some ten times the time of a product.
    VectorXl accurate(const VectorXd &b, const VectorXd &x) const {
        VectorXd high = b, low = VectorXd::Zero(size());
        algebra_->multiply_accurately(values_, part_, view(x), result(high), result(low));
        return high.cast<Real>() + low.cast<Real>();
    }

    double operator()(Index i, Index j) const {
        const bool transposed = part_ == Part::lower ? i < j : part_ == Part::upper && i > j;
        return transposed ? values_(j, i) : values_(i, j);
    }

    /// All entries.
    MatrixXd dense() const {
        if (part_ == Part::lower)
            return values_.selfadjointView<Eigen::Lower>();
        if (part_ == Part::upper)
            return values_.selfadjointView<Eigen::Upper>();
        return values_;
    }

    /// First and last + 1 of the rows of column j that are stored; works for blocks, too.
    std::pair<Index, Index> stored(Index j, Index rows) const {
        return condensed::stored(part_, j, rows);
    }

    /// The entries that couple node i to node j; of a symmetric matrix only where they are stored.
    template <int D> Eigen::Matrix<double, D, D> block(Index i, Index j) const {
        Eigen::Matrix<double, D, D> found = values_.block<D, D>(D * i, D * j);
        if (i == j && part_ == Part::lower)
            found = Eigen::Matrix<double, D, D>(found.template selfadjointView<Eigen::Lower>());
        if (i == j && part_ == Part::upper)
            found = Eigen::Matrix<double, D, D>(found.template selfadjointView<Eigen::Upper>());
        return found;
    }

    /// Of so many entries of the diagonal, from the first one on, every `step`-th.
    double mean_magnitude(Index first, Index count, Index step) const {
        const VectorXd entries = diagonal().cwiseAbs();
        return count > 0 ? entries(Eigen::seqN(first, count, step)).mean() : 0.0;
    }

    /// Largest sum of magnitudes in a column.
    double norm() const {
        VectorXd sums = VectorXd::Zero(size());
        for (Index j = 0; j < size(); ++j) {
            const auto [first, last] = stored(j, size());
            const auto column = values_.col(j).segment(first, last - first).cwiseAbs();
            if (symmetric()) {
                sums.segment(first, last - first) += column;
                sums[j] -= std::abs(values_(j, j));
            }
            sums[j] += column.sum();
        }
        return size() > 0 ? sums.maxCoeff() : 0.0;
    }

  private:
    MatrixView values_;
    Part part_;
    const LinearAlgebra *algebra_;
};
} // namespace dolfinx_contact::condensed
