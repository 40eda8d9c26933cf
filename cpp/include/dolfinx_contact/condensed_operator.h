// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_operator.h
/// W with what is derived from it once.
#pragma once

#include "condensed_system.h"
#include <algorithm>
#include <optional>

namespace dolfinx_contact::condensed {
/// W (D n + tied square) with what is derived from it once: its normal rows, and its inverse when
/// that begins to pay. If W is symmetric to the last bit, one triangle of it is kept, and its
/// inverse by Cholesky in the other triangle of the same array, which has one column more; else
/// both are whole.
///
/// The last `tied` rows are bilateral: w_c = 0, r_c of any sign. Of them W may be indefinite or
/// zero.
class Operator {
  public:
    static constexpr Index many = 64; ///< contacts from which zeros and a low rank of W pay

    /// W is copied; D = `dim` rows of a contact, tangential components first. D = 1 is contact
    /// without friction, of which the normal rows alone are needed.
    template <class Derived>
    Operator(const Eigen::MatrixBase<Derived> &W, int dim, Index tied = 0)
        : size_(W.rows()), tied_(tied), dim_(dim),
          symmetric_((W.array() == W.transpose().array()).all()),
          values_(size_, size_ + (symmetric_ ? 1 : 0)),
          W_(view(values_.data() + (symmetric_ ? size_ : 0), Square::Part::upper)) {
        if (symmetric_)
            values_.rightCols(size_).template triangularView<Eigen::Upper>() = W.derived();
        else
            values_ = W;
        find_pattern();
    }
    Operator(const Operator &) = delete; // views look into it

    const Square &W() const { return W_; }
    int dim() const { return dim_; }
    Index nodes() const { return (size_ - tied_) / dim_; }
    Index tied() const { return tied_; }

    /// Rows and columns of the normal components and of tied rows.
    const Square &normal() const {
        if (!normal_) {
            std::vector<Index> rows;
            for (Index i = 0; i < nodes(); ++i)
                rows.push_back(dim_ * i + dim_ - 1);
            for (Index c = 0; c < tied_; ++c)
                rows.push_back(dim_ * nodes() + c);
            normal_values_ = W_.dense()(rows, rows);
            const Index size = normal_values_.rows();
            normal_.emplace(normal_values_.data(), size, size,
                            symmetric_ ? Square::Part::lower : Square::Part::all);
        }
        return *normal_;
    }

    /// W as a product, if its rank is low.
    const LazyProduct &product() const { return product_; }

    /// Empty if W is not sparse.
    const Pattern &pattern() const { return pattern_; }

    /// Mean magnitude of the normal compliance of a contact.
    double mean_normal() const {
        double mean = 0.0;
        for (Index i = 0; i < nodes(); ++i)
            mean += std::abs(W_(dim_ * i + dim_ - 1, dim_ * i + dim_ - 1)) /
                    static_cast<double>(nodes());
        return mean;
    }

    /// Largest magnitude in a tied row; one if it is zero.
    double largest_in_tied_row(Index c) const {
        double largest = 0.0;
        for (Index j = 0; j < size_; ++j)
            largest = std::max(largest, std::abs(W_(dim_ * nodes() + c, j)));
        return largest > 0.0 ? largest : 1.0;
    }

    /// The inverse of W, if prepared and if W is regular, else null.
    const Square *inverse() const { return inverse_ ? &*inverse_ : nullptr; }

    /// Inverts W, so that Newton's method may eliminate sticking nodes. For many solves.
    /// Returns whether W was regular enough, and positive definite if symmetric, but for tied rows.
    bool prepare() {
        constexpr double smallest_rcond = 1e-12;
        if (inverse_ || size_ == 0)
            return true;
        if (symmetric_) {
            auto lower = values_.leftCols(size_);
            lower.triangularView<Eigen::Lower>() = values_.rightCols(size_).transpose();
            if (!invert(lower, tied_))
                return false;
            inverse_.emplace(view(values_.data(), Square::Part::lower));
        } else {
            inverse_values_ = values_.partialPivLu().inverse();
            inverse_.emplace(view(inverse_values_.data(), Square::Part::all));
        }
        if (!(inverse_->norm() * W_.norm() < 1.0 / smallest_rcond))
            inverse_.reset();
        return inverse_.has_value();
    }

  private:
    /// W is sparse if it is of many contacts and at most a tenth of its entries are not zero.
    void find_pattern() {
        constexpr Index densest = 10;
        const Index n = nodes();
        if (n < many || tied_ > 0)
            return;
        const auto stored = values_.rightCols(size_);
        Eigen::SparseMatrix<double> found(size_, size_);
        for (Index j = 0; j < size_; ++j) {
            found.startVec(j);
            for (Index i = 0; i < (symmetric_ ? j + 1 : size_); ++i)
                if (stored(i, j) != 0.0)
                    found.insertBack(i, j) = stored(i, j);
            if (found.data().size() * (symmetric_ ? 2 : 1) * densest > size_ * size_)
                return;
        }
        found.finalize();
        if (symmetric_)
            sparse_ = found.selfadjointView<Eigen::Upper>();
        else
            sparse_.swap(found);
        W_.set_sparse(&sparse_);
        for (Index j = 0; j < n; ++j) {
            std::vector<Index> contacts{j};
            for (Index k = 0; k < dim_; ++k)
                for (Eigen::SparseMatrix<double>::InnerIterator at(sparse_, dim_ * j + k); at; ++at)
                    contacts.push_back(at.row() / dim_);
            std::sort(contacts.begin(), contacts.end());
            contacts.erase(std::unique(contacts.begin(), contacts.end()), contacts.end());
            pattern_.push_back(std::move(contacts));
        }
    }

    Square view(const double *values, Square::Part triangle) const {
        return {values, size_, size_, symmetric_ ? triangle : Square::Part::all};
    }

    Index size_, tied_;
    int dim_;
    bool symmetric_;
    MatrixXd values_, inverse_values_;
    Square W_;
    LazyProduct product_{W_};
    Pattern pattern_;
    Eigen::SparseMatrix<double> sparse_;
    std::optional<Square> inverse_;
    mutable MatrixXd normal_values_;
    mutable std::optional<Square> normal_;
};

} // namespace dolfinx_contact::condensed
