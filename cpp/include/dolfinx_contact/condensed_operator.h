// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_operator.h
/// W with what is derived from it once, a solution, and the two errors that judge it.
#pragma once

#include "bipotential.h"
#include "condensed_system.h"
#include "slip_rule.h"

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
class Operator {
  public:
    /// W (D n, D n), tangential components first; copied.
    Operator(MatrixXd W, int dim) : W_(std::move(W)), dim_(dim) {}

    const MatrixXd &W() const { return W_; }
    int dim() const { return dim_; }
    Index nodes() const { return W_.rows() / dim_; }

    /// Rows and columns of the normal components.
    const MatrixXd &normal() const {
        if (normal_.size() == 0 && W_.size() > 0) {
            const auto rows = Eigen::seqN(dim_ - 1, nodes(), dim_);
            normal_ = W_(rows, rows);
        }
        return normal_;
    }

    /// The inverse of W, if prepared and if W is regular, else null.
    const MatrixXd *inverse() const { return inverse_.size() > 0 ? &inverse_ : nullptr; }

    /// Inverts W, so that Newton's method may eliminate sticking nodes. For many solves.
    /// Returns whether W was regular enough.
    bool prepare() {
        if (inverse_.size() == 0 && W_.size() > 0) {
            const Eigen::PartialPivLU<MatrixXd> lu(W_);
            if (lu.rcond() > 1e-12)
                inverse_ = lu.inverse();
        }
        return inverse_.size() > 0;
    }

  private:
    MatrixXd W_, inverse_;
    mutable MatrixXd normal_;
    int dim_;
};

/// The two errors of a state, and the units in which a problem is scaled.
template <int P> class Judge {
  public:
    static constexpr int D = P + 1;

    Judge(const Operator &op, const AnyLaw<P> &law, const VectorXd &q) : op_(op), law_(law), q_(q) {
        const Index n = op.nodes();
        double mean = 0.0;
        for (Index i = 0; i < n; ++i)
            mean += std::abs(op.W()(D * i + P, D * i + P)) / static_cast<double>(n);
        kappa_.resize(n);
        VectorXd pressed(n);
        for (Index i = 0; i < n; ++i) {
            kappa_[i] = 1.0 / std::max(std::abs(op.W()(D * i + P, D * i + P)), 1e-12 * mean);
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
