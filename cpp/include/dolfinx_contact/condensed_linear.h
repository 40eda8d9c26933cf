// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_linear.h
/// Newton's linear systems, of any rank.
#pragma once

#include "condensed_matrix.h"

namespace dolfinx_contact::condensed {
/// Solves J y = rhs and keeps the factors.
class LinearSolver {
  public:
    LinearSolver() {
        constexpr double enough = 1e-2; // of the largest entry of a column: pivots that fill less
        sparse_.setPivotThreshold(enough);
    }
    /// Factors of J, regular, in double precision.
    void factor(const MatrixXd &J) {
        kind_ = Kind::in_double;
        double_.compute(J);
    }
    /// Of a sparse one, compressed; false if it is singular.
    bool factor(const Eigen::SparseMatrix<double> &J) {
        kind_ = Kind::sparse;
        if (!ordered_for(J))
            sparse_.analyzePattern(J);
        sparse_.factorize(J);
        return sparse_.info() == Eigen::Success;
    }

    /// J of few unknowns may be singular: the shortest of the solutions that fit best is taken
    /// then. Of many unknowns a singular one is refused, unless it is `regularised`.
    bool solve(const MatrixXd &J, const VectorXd &rhs, VectorXd &y, bool regularised) {
        constexpr double smallest_rcond = 1e-14, threshold = 1e-12;
        constexpr Index worth_it = 128; // below, double precision costs nothing
        kind_ = Kind::in_single;
        if (J.rows() >= worth_it && !regularised && solve_in_single(J, rhs, y))
            return true;
        factor(J);
        if (regularised || double_.rcond() > smallest_rcond) {
            y = double_.solve(rhs);
            return true;
        }
        if (J.rows() >= worth_it)
            return false;
        kind_ = Kind::orthogonal;
        orthogonal_.setThreshold(threshold);
        y = orthogonal_.compute(J).solve(rhs);
        return true;
    }

    /// J sparse; false if it is singular.
    bool solve(const Eigen::SparseMatrix<double> &J, const VectorXd &rhs, VectorXd &y) {
        if (!factor(J))
            return false;
        y = sparse_.solve(rhs);
        return y.allFinite();
    }

    /// The entries of sparse factors over those of dense ones.
    double fill() const {
        const auto n = static_cast<double>(sparse_.rows());
        return static_cast<double>(sparse_.nnzL() + sparse_.nnzU()) / (n * n);
    }

    /// Whether there are factors of many unknowns: in single precision, or sparse ones.
    bool of_many() const {
        return (kind_ == Kind::in_single && single_.rows() > 0) || kind_ == Kind::sparse;
    }

    /// With the factors of the last matrix; those in single precision are not refined.
    VectorXd again(const VectorXd &rhs) const {
        if (kind_ == Kind::in_double)
            return double_.solve(rhs);
        if (kind_ == Kind::sparse)
            return sparse_.solve(rhs);
        if (kind_ == Kind::orthogonal)
            return orthogonal_.solve(rhs);
        const double scale = rhs.lpNorm<Eigen::Infinity>();
        if (!(scale > 0.0))
            return VectorXd::Zero(rhs.size());
        return scale * single_.solve((rhs / scale).cast<float>()).cast<double>();
    }

  private:
    /// Whether the last sparse matrix had entries in the same places; keeps those of J.
    bool ordered_for(const Eigen::SparseMatrix<double> &J) {
        const int *outer = J.outerIndexPtr(), *inner = J.innerIndexPtr();
        std::vector<int> places(outer, outer + J.outerSize() + 1);
        places.insert(places.end(), inner, inner + J.nonZeros());
        const bool same = places == places_;
        places_ = std::move(places);
        return same;
    }

    enum class Kind { in_single, in_double, orthogonal, sparse };

    /// By iterative refinement; false if that does not converge, because J is too badly
    /// conditioned for it.
    bool solve_in_single(const MatrixXd &J, const VectorXd &rhs, VectorXd &y) {
        constexpr double accuracy = 1e-12, contraction = 0.1;
        const double scale = rhs.lpNorm<Eigen::Infinity>();
        single_.compute(J.cast<float>());
        y.setZero(rhs.size());
        VectorXd rest = rhs;
        for (double size = scale; size > accuracy * scale;) {
            const Eigen::VectorXf unit = (rest / size).cast<float>();
            y += size * single_.solve(unit).cast<double>();
            rest = rhs - J * y;
            const double after = rest.lpNorm<Eigen::Infinity>();
            if (!(after <= contraction * size))
                return after <= 1e2 * accuracy * scale;
            size = after;
        }
        return true;
    }

    Kind kind_ = Kind::in_double;
    Eigen::PartialPivLU<Eigen::MatrixXf> single_;
    Eigen::PartialPivLU<MatrixXd> double_;
    Eigen::CompleteOrthogonalDecomposition<MatrixXd> orthogonal_;
    Eigen::SparseLU<Eigen::SparseMatrix<double>> sparse_;
    std::vector<int> places_; // of the entries of the last sparse matrix
};
} // namespace dolfinx_contact::condensed
