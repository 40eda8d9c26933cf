// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file linear_algebra.h
/// The linear algebra that takes most of the solver's time, behind an interface: it alone is
/// compiled once for each set of instructions.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <memory>
#include <utility>

namespace dolfinx_contact::condensed {
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Arrays cross the interface as views: what is compiled for other instructions does not allocate
/// in the same way.
using VectorView = Eigen::Map<const VectorXd>;
using MatrixView = Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>>;
using VectorResult = Eigen::Map<VectorXd>;
using MatrixResult = Eigen::Map<MatrixXd, 0, Eigen::OuterStride<>>;

inline VectorView view(const VectorXd &v) { return {v.data(), v.size()}; }
inline VectorResult result(VectorXd &v) { return {v.data(), v.size()}; }
template <class Matrix> MatrixView view(const Eigen::DenseBase<Matrix> &A) {
    return {A.derived().data(), A.rows(), A.cols(),
            Eigen::OuterStride<>(A.derived().outerStride())};
}
template <class Matrix> MatrixResult result(Eigen::DenseBase<Matrix> &A) {
    return {A.derived().data(), A.rows(), A.cols(),
            Eigen::OuterStride<>(A.derived().outerStride())};
}

/// Called every few tenths of a second; what it throws ends a factorisation.
using Poll = std::function<void()>;

/// Solves J y = rhs and keeps the factors.
class LinearSolver {
  public:
    LinearSolver() = default;
    LinearSolver(const LinearSolver &) = delete;
    virtual ~LinearSolver() = default;

    /// Factors of J in double precision; false if it is singular.
    bool factor(const MatrixXd &J) { return take(view(J)); }

    /// J of few unknowns may be singular: the shortest of the solutions that fit best is taken
    /// then. Of many unknowns a singular one is refused, unless it is `regularised`.
    bool solve(const MatrixXd &J, const VectorXd &rhs, VectorXd &y, bool regularised) {
        y.resize(rhs.size());
        return solve(view(J), view(rhs), result(y), regularised);
    }
    /// With the factors of the last matrix; those in single precision are not refined.
    VectorXd again(const VectorXd &rhs) const {
        VectorXd y(rhs.size());
        again(view(rhs), result(y));
        return y;
    }

    /// Whether there are factors of many unknowns, in single precision.
    virtual bool of_many() const = 0;

  protected:
    virtual bool take(const MatrixView &J) = 0;
    virtual bool solve(const MatrixView &J, const VectorView &rhs, VectorResult y,
                       bool regularised) = 0;
    virtual void again(const VectorView &rhs, VectorResult y) const = 0;
};

/// Which entries of a square matrix are stored: all, or, if it is symmetric, one triangle.
enum class Part { all, lower, upper };

/// First and last + 1 of the rows of column j that are stored; works for blocks, too.
inline std::pair<Index, Index> stored(Part part, Index j, Index rows) {
    return {part == Part::lower ? j : 0, part == Part::upper ? j + 1 : rows};
}

class LinearAlgebra {
  public:
    LinearAlgebra() = default;
    LinearAlgebra(const LinearAlgebra &) = delete;
    virtual ~LinearAlgebra() = default;

    /// `poll` outlives the solver.
    virtual std::unique_ptr<LinearSolver> solver(const Poll &poll) const = 0;

    /// y = A x of a square matrix.
    virtual void multiply(const MatrixView &A, Part part, const VectorView &x,
                          VectorResult y) const = 0;
    /// high + low = high + A x in twice the precision.
    virtual void multiply_accurately(const MatrixView &A, Part part, const VectorView &x,
                                     VectorResult high, VectorResult low) const = 0;
    /// y = |A| |x|.
    virtual void magnitudes(const MatrixView &A, Part part, const VectorView &x,
                            VectorResult y) const = 0;
    /// A = A^-1. Of a symmetric one the lower triangle, which is positive definite but for its last
    /// `tied` rows; false, and the triangle lost, if it is not.
    virtual bool invert(MatrixResult A, Part part, Index tied) const = 0;
};

/// By Eigen, for the instructions that all else is compiled for; eigen.h has the definition. A
/// template, so that a program may link it instead of compiling it.
template <class = void> const LinearAlgebra &linear_algebra();
} // namespace dolfinx_contact::condensed
