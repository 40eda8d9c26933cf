// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_matrix.h
/// W and its inverse: a symmetric pair shares one array, a triangle each.
#pragma once

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <cmath>
#include <utility>
#include <vector>

namespace dolfinx_contact::condensed {
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Real = long double; ///< of the judge; where it is no more than double, so much the worse
using VectorXl = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

/// Sums of products of doubles, each as if in twice the precision
/// [T. Ogita, S. M. Rump, S. Oishi, SIAM J. Sci. Comput. 26 (2005), Algorithm 5.3, Dot2].
class AccurateSums {
  public:
    explicit AccurateSums(const VectorXd &start)
        : high_(start), low_(VectorXd::Zero(start.size())) {}

    void add(Index i, double a, double b) {
        const double product = a * b, before = high_[i], sum = before + product;
        const double added = sum - before;
        high_[i] = sum;
        low_[i] += (before - (sum - added)) + (product - added) + std::fma(a, b, -product);
    }
    VectorXl sums() const { return high_.cast<Real>() + low_.cast<Real>(); }

  private:
    VectorXd high_, low_;
};

using Sparse = Eigen::SparseMatrix<double>;

/// A square matrix of which all or, if it is symmetric, one triangle is stored, or all entries but
/// the zeros; a view.
class Square {
  public:
    enum class Part { all, lower, upper };

    Square(const double *values, Index size, Index stride, Part part)
        : values_(values, size, size, Eigen::OuterStride<>(stride)), part_(part) {}
    Square(const Sparse &sparse, bool symmetric)
        : values_(nullptr, sparse.rows(), sparse.cols(), Eigen::OuterStride<>(sparse.rows())),
          part_(symmetric ? Part::upper : Part::all), sparse_(&sparse) {}

    Index size() const { return values_.rows(); }
    bool symmetric() const { return part_ != Part::all; }
    const Sparse *sparse() const { return sparse_; } ///< null if it is stored as a dense one
    VectorXd diagonal() const {
        return sparse_ != nullptr ? VectorXd(sparse_->diagonal()) : VectorXd(values_.diagonal());
    }

    VectorXd operator*(const VectorXd &x) const {
        VectorXd y = VectorXd::Zero(size());
        if (x.isZero(0.0))
            return y;
        if (sparse_ != nullptr)
            return *sparse_ * x;
        if (part_ == Part::lower)
            y.noalias() += values_.selfadjointView<Eigen::Lower>() * x;
        else if (part_ == Part::upper)
            y.noalias() += values_.selfadjointView<Eigen::Upper>() * x;
        else
            y.noalias() += values_ * x;
        return y;
    }

    /// |A| |x|: the size of what is added up in a product.
    VectorXd magnitudes(const VectorXd &x) const {
        if (x.isZero(0.0))
            return VectorXd::Zero(size());
        const VectorXd size_of_x = x.cwiseAbs();
        if (sparse_ != nullptr)
            return sparse_->cwiseAbs() * size_of_x;
        VectorXd y = VectorXd::Zero(size());
        for (Index j = 0; j < size(); ++j) {
            const auto [first, last] = stored(j, size());
            const auto column = values_.col(j).segment(first, last - first).cwiseAbs();
            const double diagonal = std::abs(values_(j, j)) * size_of_x[j];
            y.segment(first, last - first) += size_of_x[j] * column;
            if (symmetric())
                y[j] += column.dot(size_of_x.segment(first, last - first)) - diagonal;
        }
        return y;
    }

    /// b + A x in twice the precision; some ten times the time of a product.
    VectorXl accurate(const VectorXd &b, const VectorXd &x) const {
        AccurateSums y(b);
        if (sparse_ != nullptr) {
            for (Index j = 0; j < size(); ++j)
                for (Sparse::InnerIterator at(*sparse_, j); at; ++at)
                    y.add(at.row(), at.value(), x[j]);
            return y.sums();
        }
        for (Index j = 0; j < size(); ++j) {
            const auto [first, last] = stored(j, size());
            for (Index i = first; i < last; ++i) {
                y.add(i, values_(i, j), x[j]);
                if (symmetric() && i != j)
                    y.add(j, values_(i, j), x[i]);
            }
        }
        return y.sums();
    }

    double operator()(Index i, Index j) const {
        if (sparse_ != nullptr)
            return sparse_->coeff(i, j);
        const bool transposed = part_ == Part::lower ? i < j : part_ == Part::upper && i > j;
        return transposed ? values_(j, i) : values_(i, j);
    }

    /// All entries.
    MatrixXd dense() const {
        if (sparse_ != nullptr)
            return *sparse_;
        if (part_ == Part::lower)
            return values_.selfadjointView<Eigen::Lower>();
        if (part_ == Part::upper)
            return values_.selfadjointView<Eigen::Upper>();
        return values_;
    }

    /// First and last + 1 of the rows of column j that are stored; works for blocks, too. Not of a
    /// sparse one.
    std::pair<Index, Index> stored(Index j, Index rows) const {
        return {part_ == Part::lower ? j : 0, part_ == Part::upper ? j + 1 : rows};
    }

    /// The entries that couple node i to node j; of a symmetric matrix only where they are stored.
    template <int D> Eigen::Matrix<double, D, D> block(Index i, Index j) const {
        if (sparse_ != nullptr)
            return sparse_->block(D * i, D * j, D, D).toDense();
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
        if (sparse_ != nullptr)
            sums = sparse_->cwiseAbs().transpose() * VectorXd::Ones(size());
        for (Index j = 0; j < size() && sparse_ == nullptr; ++j) {
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
    Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>> values_;
    Part part_;
    const Sparse *sparse_ = nullptr;
};

/// Inverts a symmetric positive definite matrix in place, lower triangle, by halves: n^3
/// operations, where factors and solves for the columns of the identity take 7/3 n^3. False, and
/// the triangle lost, if it is not positive definite.
// NOLINTNEXTLINE(misc-no-recursion): as deep as the logarithm of n
inline bool invert(Eigen::Ref<MatrixXd> A) {
    const Index n = A.rows(), half = n / 2;
    if (n <= 64) { // smaller halves save nothing
        const Eigen::LLT<MatrixXd> factors(A);
        if (factors.info() != Eigen::Success)
            return false;
        A.triangularView<Eigen::Lower>() = factors.solve(MatrixXd::Identity(n, n));
        return true;
    }
    auto first = A.topLeftCorner(half, half), last = A.bottomRightCorner(n - half, n - half);
    auto coupling = A.bottomLeftCorner(n - half, half);
    if (!invert(first))
        return false;
    const MatrixXd X = coupling * first.selfadjointView<Eigen::Lower>();
    last.triangularView<Eigen::Lower>() -= X * coupling.transpose();
    if (!invert(last))
        return false;
    coupling.noalias() = last.selfadjointView<Eigen::Lower>() * X;
    first.triangularView<Eigen::Lower>() += X.transpose() * coupling;
    coupling = -coupling;
    return true;
}

/// The same, of the last `tied` rows, which may make the matrix indefinite, by their Schur
/// complement. False if that is singular.
inline bool invert(Eigen::Ref<MatrixXd> A, Index tied) {
    const Index n = A.rows() - tied;
    auto first = A.topLeftCorner(n, n), last = A.bottomRightCorner(tied, tied);
    auto coupling = A.bottomLeftCorner(tied, n);
    if (!invert(first))
        return false;
    if (tied == 0)
        return true;
    const MatrixXd X = coupling * first.selfadjointView<Eigen::Lower>();
    last.triangularView<Eigen::Lower>() -= X * coupling.transpose();
    const Eigen::FullPivLU<MatrixXd> complement(MatrixXd(last.selfadjointView<Eigen::Lower>()));
    if (!complement.isInvertible())
        return false;
    const MatrixXd inverse = complement.inverse();
    last.triangularView<Eigen::Lower>() = (inverse + inverse.transpose()) / 2.0;
    coupling.noalias() = last.selfadjointView<Eigen::Lower>() * X;
    first.triangularView<Eigen::Lower>() += X.transpose() * coupling;
    coupling = -coupling;
    return true;
}
} // namespace dolfinx_contact::condensed
