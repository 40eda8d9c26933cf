// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_operator.h
/// W with what is derived from it once, a solution, and the two errors that judge it.
#pragma once

#include "bipotential.h"
#include "condensed_system.h"
#include "slip_rule.h"
#include <optional>

namespace dolfinx_contact::condensed {
/// One entry of the cascade that was tried.
struct Attempt {
    std::string branch;
    bool converged;
    int iterations;
    double seconds, error, slip_error; ///< the errors of the best state so far
};

/// Reactions and displacements, (T + 1) per node, in the units of q and W.
struct Solution {
    VectorXd reaction, displacement;
    std::vector<Branch> status;
    double error = std::numeric_limits<double>::infinity();
    double slip_error = std::numeric_limits<double>::infinity();
    int iterations = 0;
    double seconds = 0.0;
    bool converged = false;
    std::string branch;
    std::vector<Attempt> tried;
};

/// W with what is derived from it once: its normal rows, and its inverse when that begins to pay.
/// If W is symmetric to the last bit, one triangle of it is kept, and its inverse by Cholesky in
/// the other triangle of the same array, which has one column more; else both are whole.
class Operator {
  public:
    /// W (D n, D n), D = `dim`, tangential components first; copied. D = 1 is contact without
    /// friction, of which the normal rows alone are needed.
    template <class Derived>
    Operator(const Eigen::MatrixBase<Derived> &W, int dim)
        : size_(W.rows()), dim_(dim), symmetric_((W.array() == W.transpose().array()).all()),
          values_(size_, size_ + (symmetric_ ? 1 : 0)),
          W_(view(values_.data() + (symmetric_ ? size_ : 0), Square::Part::upper)) {
        if (symmetric_)
            values_.rightCols(size_).template triangularView<Eigen::Upper>() = W.derived();
        else
            values_ = W;
    }
    Operator(const Operator &) = delete; // views look into it

    const Square &W() const { return W_; }
    int dim() const { return dim_; }
    Index nodes() const { return size_ / dim_; }

    /// Rows and columns of the normal components.
    const Square &normal() const {
        if (!normal_) {
            const auto rows = Eigen::seqN(dim_ - 1, nodes(), dim_);
            normal_values_ = W_.dense()(rows, rows);
            normal_.emplace(normal_values_.data(), nodes(), nodes(),
                            symmetric_ ? Square::Part::lower : Square::Part::all);
        }
        return *normal_;
    }

    /// The inverse of W, if prepared and if W is regular, else null.
    const Square *inverse() const { return inverse_ ? &*inverse_ : nullptr; }

    /// Inverts W, so that Newton's method may eliminate sticking nodes. For many solves.
    /// Returns whether W was regular enough, and positive definite if symmetric.
    bool prepare() {
        constexpr double smallest_rcond = 1e-12;
        if (inverse_ || size_ == 0)
            return true;
        if (symmetric_) {
            auto lower = values_.leftCols(size_);
            lower.triangularView<Eigen::Lower>() = values_.rightCols(size_).transpose();
            if (!invert(lower))
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
    Square view(const double *values, Square::Part triangle) const {
        return {values, size_, size_, symmetric_ ? triangle : Square::Part::all};
    }

    Index size_;
    int dim_;
    bool symmetric_;
    MatrixXd values_, inverse_values_;
    Square W_;
    std::optional<Square> inverse_;
    mutable MatrixXd normal_values_;
    mutable std::optional<Square> normal_;
};

/// The two errors of a state, and the units in which a problem is scaled.
template <int P> class Judge {
  public:
    static constexpr int D = P + 1;

    Judge(const Operator &op, const AnyLaw<P> &law, const VectorXd &q) : op_(op), law_(law), q_(q) {
        const Index n = op.nodes();
        const VectorXd diagonal = op.W().diagonal();
        double mean = 0.0;
        for (Index i = 0; i < n; ++i)
            mean += std::abs(diagonal[D * i + P]) / static_cast<double>(n);
        kappa_.resize(n);
        VectorXd pressed(n);
        for (Index i = 0; i < n; ++i) {
            kappa_[i] = 1.0 / std::max(std::abs(diagonal[D * i + P]), 1e-12 * mean);
            pressed[i] = kappa_[i] * std::max(-q[D * i + P], 0.0);
            Local<P> loaded = q.segment<D>(D * i);
            loaded[P] = std::min(loaded[P], 0.0);
            length_ = std::max(length_, loaded.stableNorm());
        }
        load_ = pressed.stableNorm();
        force_ = length_ / mean;
    }

    double length() const { return length_; } ///< largest load displacement
    double force() const { return force_; }   ///< over the mean normal compliance
    double load() const { return load_; }

    /// Displacement, status and errors of the reactions of a solution.
    void judge(Solution &s) const {
        s.displacement = q_ + op_.W() * s.reaction;
        s.status.resize(static_cast<std::size_t>(op_.nodes()));
        VectorXd defect(s.reaction.size());
        double slip = 0.0;
        std::visit(
            [&](const auto &source) {
                for (Index i = 0; i < op_.nodes(); ++i) {
                    const auto &law = source(static_cast<std::size_t>(i));
                    constexpr int L = std::decay_t<decltype(law)>::tangents; // 0 without friction
                    const Local<L> r = s.reaction.segment<D>(D * i).template tail<L + 1>();
                    const Tangent<L> du = s.displacement.segment<L>(D * i);
                    const Reaction<L> mapped =
                        bipotential_map(law, r, s.displacement[D * i + P], du, kappa_[i]);
                    defect.segment<D>(D * i).setZero();
                    defect.segment<D>(D * i).template tail<L + 1>() = r - mapped.r;
                    s.status[static_cast<std::size_t>(i)] = mapped.branch;
                    slip = std::max(slip, slip_defect(law, r, du, mapped.branch));
                }
            },
            law_);
        s.error = defect.stableNorm() / load_;
        s.slip_error = slip > 0.0 ? slip / length_ : 0.0;
        if (!std::isfinite(s.error) || !std::isfinite(s.slip_error))
            s.error = s.slip_error = std::numeric_limits<double>::infinity();
    }

  private:
    const Operator &op_;
    const AnyLaw<P> &law_;
    const VectorXd &q_;
    VectorXd kappa_;
    double length_ = 0.0, force_ = 0.0, load_ = 0.0;
};
} // namespace dolfinx_contact::condensed
