// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file operator.h
/// W with what is derived from it once.
#pragma once

#include "../algebra/square.h"
#include "../tuning.h"
#include <algorithm>
#include <optional>

namespace dolfinx_contact::condensed {
/// W (D n + tied square) with what is derived from it once: its normal rows, and its inverse if the
/// caller has asked for it. If it is symmetric to the last bit, one triangle is kept, and its
/// inverse by Cholesky in the other triangle of the same array, which has one column more; else
/// both are whole.
///
/// The last `tied` rows are bilateral: w_c = 0, r_c of any sign. Of them W may be indefinite or
/// zero.
class Operator {
  public:
    /// W is copied; `algebra` outlives the operator; D = `dim` rows of a contact, tangential
    /// components first. D = 1 is contact without friction, of which the normal rows alone are
    /// needed.
    template <class Derived>
    Operator(const Eigen::MatrixBase<Derived> &W, int dim, Index tied = 0,
             const LinearAlgebra &algebra = linear_algebra())
        : size_(W.rows()), tied_(tied), dim_(dim), exponent_(Power::to_one(W)), algebra_(algebra),
          symmetric_(equals_transpose(W)) {
        values_.resize(size_, size_ + (symmetric_ ? 1 : 0));
        auto whole = values_.rightCols(size_);
        // of a symmetric W what is left of the diagonal is written, too, but not read
        in_tiles(size_, [&](Index i, Index j, Index rows, Index columns) {
            if (!symmetric_ || i <= j)
                whole.block(i, j, rows, columns) = Power(exponent_)(W.block(i, j, rows, columns));
            return true;
        });
        W_.emplace(square(values_.data() + (symmetric_ ? size_ : 0), Part::upper));
    }
    Operator(const Operator &) = delete; // views look into it

    /// Times two to the power `exponent`, so that its largest entry is between a half and one.
    const Square &W() const { return *W_; }
    int exponent() const { return exponent_; }
    int dim() const { return dim_; }
    Index nodes() const { return (size_ - tied_) / dim_; }
    Index tied() const { return tied_; }

    /// Rows and columns of the normal components and of tied rows.
    const Square &normal() const {
        if (normal_)
            return *normal_;
        std::vector<Index> rows;
        for (Index i = 0; i < nodes(); ++i)
            rows.push_back(dim_ * i + dim_ - 1);
        for (Index c = 0; c < tied_; ++c)
            rows.push_back(dim_ * nodes() + c);
        const auto size = static_cast<Index>(rows.size());
        normal_values_ = W_->dense()(rows, rows);
        return normal_.emplace(normal_values_.data(), size, size,
                               symmetric_ ? Part::lower : Part::all, algebra_);
    }

    /// Mean magnitude of the normal compliance of a contact.
    double mean_normal() const { return W_->mean_magnitude(dim_ - 1, nodes(), dim_); }

    /// Largest magnitude in a tied row; one if it is zero.
    double largest_in_tied_row(Index c) const {
        double largest = 0.0;
        for (Index j = 0; j < size_; ++j)
            largest = std::max(largest, std::abs((*W_)(dim_ * nodes() + c, j)));
        return largest > 0.0 ? largest : 1.0;
    }

    /// The inverse of W, if prepared and if W is regular, else null.
    const Square *inverse() const { return inverse_ ? &*inverse_ : nullptr; }

    /// Inverts W, so that Newton's method may eliminate sticking nodes. For many solves.
    /// Returns whether W was regular enough, and positive definite if symmetric, but for tied rows.
    bool prepare() {
        if (inverse_ || size_ == 0)
            return true;
        if (symmetric_) {
            auto lower = values_.leftCols(size_);
            lower.triangularView<Eigen::Lower>() = values_.rightCols(size_).transpose();
            if (!algebra_.invert(result(lower), Part::lower, tied_))
                return false;
            inverse_.emplace(square(values_.data(), Part::lower));
        } else {
            inverse_values_ = W_->dense();
            algebra_.invert(result(inverse_values_), Part::all, tied_);
            inverse_.emplace(inverse_values_.data(), size_, size_, Part::all, algebra_);
        }
        if (!(inverse_->norm() * W_->norm() < 1.0 / Tuning::smallest_rcond))
            inverse_.reset();
        return inverse_.has_value();
    }

  private:
    /// all(i, j, rows, columns) of the tiles of a square until it is false. Where one matrix is
    /// read along its rows and another along its columns, tiles stay in the processor's cache.
    template <class Predicate> static bool in_tiles(Index size, Predicate all) {
        for (Index j = 0; j < size; j += Tuning::tile)
            for (Index i = 0; i < size; i += Tuning::tile)
                if (!all(i, j, std::min(Tuning::tile, size - i), std::min(Tuning::tile, size - j)))
                    return false;
        return true;
    }
    template <class Derived> static bool equals_transpose(const Eigen::MatrixBase<Derived> &W) {
        return in_tiles(W.rows(), [&](Index i, Index j, Index m, Index n) {
            return i > j ||
                   (W.block(i, j, m, n).array() == W.block(j, i, n, m).transpose().array()).all();
        });
    }
    Square square(const double *values, Part triangle) const {
        return {values, size_, size_, symmetric_ ? triangle : Part::all, algebra_};
    }

    Index size_, tied_;
    int dim_, exponent_;
    const LinearAlgebra &algebra_;
    bool symmetric_;
    MatrixXd values_, inverse_values_;
    std::optional<Square> W_;
    std::optional<Square> inverse_;
    mutable MatrixXd normal_values_;
    mutable std::optional<Square> normal_;
};

} // namespace dolfinx_contact::condensed
