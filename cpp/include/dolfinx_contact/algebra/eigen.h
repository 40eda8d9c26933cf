// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file eigen.h
/// The linear algebra of the condensed solver by Eigen.
#pragma once

#include "lu.h"
#include <cmath>

namespace dolfinx_contact::condensed {
/// Sums of products of doubles, each as if in twice the precision
/// [T. Ogita, S. M. Rump, S. Oishi, SIAM J. Sci. Comput. 26 (2005), Algorithm 5.3, Dot2].
struct AccurateSums {
    VectorResult high, low;

    void add(Index i, double a, double b) {
        const double product = a * b, before = high[i], sum = before + product;
        const double added = sum - before;
        high[i] = sum;
        low[i] += (before - (sum - added)) + (product - added) + std::fma(a, b, -product);
    }
};

class EigenSolver final : public LinearSolver {
  public:
    explicit EigenSolver(const Poll &poll) : poll_(poll) {}

    bool of_many() const override { return kind_ == Kind::in_single && single_.rows() > 0; }

  protected:
    bool take(const MatrixView &J) override {
        kind_ = Kind::in_double;
        double_.compute(J, poll_);
        return double_.pivots() > Tuning::smallest_pivot;
    }

    bool solve(const MatrixView &J, const VectorView &rhs, VectorResult y,
               bool regularised) override {
        const bool many = J.rows() >= Tuning::worth_single_precision;
        if (many && !regularised && solve_in_single(J, rhs, y))
            return true;
        if (take(J) || regularised) {
            y = double_.solve(rhs);
            return true;
        }
        if (many)
            return false;
        kind_ = Kind::orthogonal;
        orthogonal_.setThreshold(Tuning::smallest_of_rank);
        y = orthogonal_.compute(J).solve(rhs);
        return true;
    }

    void again(const VectorView &rhs, VectorResult y) const override {
        if (kind_ == Kind::in_double)
            y = double_.solve(rhs);
        else if (kind_ == Kind::orthogonal)
            y = orthogonal_.solve(rhs);
        else if (const double scale = rhs.lpNorm<Eigen::Infinity>(); scale > 0.0)
            y = scale * single_.solve((rhs / scale).cast<float>()).cast<double>();
        else
            y.setZero();
    }

  private:
    /// By iterative refinement; false if that does not converge, because J is too badly
    /// conditioned for it.
    bool solve_in_single(const MatrixView &J, const VectorView &rhs, VectorResult &y) {
        const double scale = rhs.lpNorm<Eigen::Infinity>();
        kind_ = Kind::in_single;
        single_.compute(J.cast<float>(), poll_);
        y.setZero();
        VectorXd rest = rhs;
        for (double size = scale; size > Tuning::refined * scale;) {
            const Eigen::VectorXf unit = (rest / size).cast<float>();
            y += size * single_.solve(unit).cast<double>();
            rest = rhs;
            rest.noalias() -= J * y;
            const double after = rest.lpNorm<Eigen::Infinity>();
            if (!(after <= Tuning::refinement * size))
                return after <= Tuning::refined_enough * scale;
            size = after;
        }
        return true;
    }

    enum class Kind { in_single, in_double, orthogonal };

    const Poll &poll_;
    Kind kind_ = Kind::in_double;
    LU<float> single_;
    LU<double> double_;
    Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal_;
};

class EigenAlgebra final : public LinearAlgebra {
  public:
    std::unique_ptr<LinearSolver> solver(const Poll &poll) const override {
        return std::make_unique<EigenSolver>(poll);
    }

    void multiply(const MatrixView &A, Part part, const VectorView &x,
                  VectorResult y) const override {
        y.setZero();
        if (part == Part::all)
            y.noalias() = A * x;
        else if (part == Part::lower)
            y.noalias() += A.selfadjointView<Eigen::Lower>() * x;
        else
            y.noalias() += A.selfadjointView<Eigen::Upper>() * x;
    }
    void multiply_accurately(const MatrixView &A, Part part, const VectorView &x, VectorResult high,
                             VectorResult low) const override {
        AccurateSums sums{high, low};
        for (Index j = 0; j < A.cols(); ++j) {
            const auto [first, last] = stored(part, j, A.rows());
            for (Index i = first; i < last; ++i) {
                sums.add(i, A(i, j), x[j]);
                if (part != Part::all && i != j)
                    sums.add(j, A(i, j), x[i]);
            }
        }
    }
    void magnitudes(const MatrixView &A, Part part, const VectorView &x,
                    VectorResult y) const override {
        const VectorXd size_of_x = x.cwiseAbs();
        y.setZero();
        for (Index j = 0; j < A.cols(); ++j) {
            const auto [first, last] = stored(part, j, A.rows());
            const auto column = A.col(j).segment(first, last - first).cwiseAbs();
            const double diagonal = std::abs(A(j, j)) * size_of_x[j];
            y.segment(first, last - first) += size_of_x[j] * column;
            if (part != Part::all)
                y[j] += column.dot(size_of_x.segment(first, last - first)) - diagonal;
        }
    }
    bool invert(MatrixResult A, Part part, Index tied) const override {
        if (part != Part::all)
            return invert(A, tied);
        A = Eigen::PartialPivLU<MatrixXd>(A).inverse();
        return true;
    }

  private:
    /// Inverts a symmetric positive definite matrix in place, lower triangle, by halves: n^3
    /// operations, where factors and solves for the columns of the identity take 7/3 n^3.
    // NOLINTNEXTLINE(misc-no-recursion): as deep as the logarithm of n
    static bool invert(Eigen::Ref<MatrixXd> A) {
        const Index n = A.rows(), half = n / 2;
        if (n <= Tuning::few_rows_to_invert) {
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
    static bool invert(Eigen::Ref<MatrixXd> A, Index tied) {
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
};

template <class> const LinearAlgebra &linear_algebra() {
    static const EigenAlgebra algebra;
    return algebra;
}
} // namespace dolfinx_contact::condensed
