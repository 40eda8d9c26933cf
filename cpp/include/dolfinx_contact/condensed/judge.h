// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file judge.h
/// The errors of a state, over the forces that act in it, and the rounding below which nothing can
/// be asked.
#pragma once

#include "exact.h"
#include "problem.h"
#include <stdexcept>

namespace dolfinx_contact::condensed {
/// The two errors of a state and their rounding.
template <int P> class Judge {
  public:
    static constexpr int D = P + 1;
    using Block = Eigen::Matrix<double, P, P>;

    /// @param tol the smaller of the tolerances: W r is summed in twice the precision where its
    ///   rounding might be seen beside it
    Judge(const Operator &op, const AnyLaw<P> &law, const VectorXd &q, const Scales &scales,
          double tol)
        : op_(op), law_(law), q_(q), external_(scales.external), tol_(tol),
          given_(scales.tangential.size() > 0) {
        const Index n = op.nodes();
        const VectorXd diagonal = op.W().diagonal();
        const double floor = Tuning::negligible * op.mean_normal();
        floor_ = floor > 0.0 ? floor : 1.0;
        kappa_ = checked(scales.stiffness, n, "stiffness");
        tied_ = checked(scales.tied, op.tied(), "tied_stiffness");
        if (scales.stiffness.size() == 0)
            for (Index i = 0; i < n; ++i)
                kappa_[i] = 1.0 / std::max(std::abs(diagonal[D * i + P]), floor_);
        if (scales.tied.size() == 0)
            for (Index c = 0; c < op.tied(); ++c)
                tied_[c] = 1.0 / op.largest_in_tied_row(c);
        if (!(external_ >= 0.0 && std::isfinite(external_)))
            throw std::invalid_argument("external must be a finite force, at least zero");
        set_tangential(scales.tangential);
        VectorXd loads = q;
        for (Index i = 0; i < n; ++i) {
            loads[D * i + P] = std::min(q[D * i + P], 0.0);
            loads.segment<D>(D * i) *= kappa_[i];
        }
        loads.tail(op.tied()).array() *= tied_.array();
        load_ = loads.stableNorm();
        for (Index i = 0; i < n; ++i)
            loads[D * i + P] = kappa_[i] * q[D * i + P];
        acts_ = external_ > eps * loads.stableNorm();
    }

    /// Displacement, status, errors and rounding of the reactions of a solution. The forces that
    /// act, S, are |r|, but no more than the load |kappa (q_t, min(q_n, 0))|: else reactions that
    /// grow without bound would solve a problem without solution. With C the size of the terms that
    /// cancel, in the units of a force:
    /// - S > eps C: what is left over S, rounding eps C / S;
    /// - else nothing acts to rounding: right if no more than eps C is left, and then given over C;
    ///   but if the external force acts beside q, the state is so far away that no digit is left.
    void judge(Solution &s) const {
        const bool free = s.reaction.isZero(0.0);
        const VectorXd size = q_.cwiseAbs() + op_.W().magnitudes(s.reaction);
        VectorXl w = (q_ + op_.W() * s.reaction).template cast<Real>();
        Left left = measure(s, w, size);
        const double contacts = s.reaction.head(D * op_.nodes()).stableNorm();
        s.acting = std::max(std::min(contacts, load_), external_);
        s.near_rounding =
            eps * std::max(left.size, left.slip_size) > Tuning::near_rounding * tol_ * s.acting;
        if (s.near_rounding && !free) {
            w = op_.W().accurate(q_, s.reaction);
            left = measure(s, w, size);
        }
        s.displacement = w.template cast<double>();
        if (!(s.acting > eps * left.size)) { // nor is there a direction of slip then
            s.acting = left.law <= eps * left.size ? left.size : eps * left.size;
            left.slip = left.slip_size = 0.0;
        }
        s.error = ratio(left.law, s.acting);
        s.slip_error = ratio(left.slip, s.acting);
        s.local_error = left.local;
        s.rounding = eps * ratio(left.size, s.acting);
        s.slip_rounding = eps * ratio(left.slip_size, s.acting);
        const bool lost = acts_ && external_ <= eps * left.size;
        if (lost || contacts > Tuning::unbounded * std::max(load_, external_))
            s.error = std::numeric_limits<double>::infinity();
    }

    /// Whether the errors of a judged state are within their tolerances or within rounding.
    static bool accepts(const Solution &s, const Options &options) {
        return reached(s.error, options.tol, s.rounding) &&
               reached(s.slip_error, options.slip_tol, s.slip_rounding) &&
               s.local_error <= options.local_tol;
    }
    /// What is not finite never is.
    static bool reached(double error, double tol, double rounding) {
        return std::isfinite(error) && std::isfinite(rounding) && error <= std::max(tol, rounding);
    }

  private:
    static constexpr double eps = std::numeric_limits<double>::epsilon();
    static constexpr double local_rounding = Tuning::local_rounding * eps;

    /// What the law and the slip rule leave, and the size of the terms of which it is the
    /// difference; forces, Euclidean over all contacts. The largest of a contact over its own
    /// scale.
    struct Left {
        double law, slip, size, slip_size, local;
    };

    static double ratio(double part, double whole) {
        const double found = part > 0.0 ? part / whole : (part == 0.0 ? 0.0 : part);
        return std::isfinite(found) ? found : std::numeric_limits<double>::infinity();
    }

    static VectorXd checked(const VectorXd &given, Index size, const char *name) {
        if (given.size() == 0)
            return VectorXd::Ones(size);
        if (given.size() != size)
            throw std::invalid_argument(std::string(name) + " must have " + std::to_string(size) +
                                        " entries, not " + std::to_string(given.size()));
        if (!(given.minCoeff() > 0.0) || !given.allFinite())
            throw std::invalid_argument(std::string(name) + " must be positive and finite");
        return given;
    }

    /// The tangential stiffness of each contact, or W's compliance if none is given.
    void set_tangential(const VectorXd &given) {
        blocks_.resize(static_cast<std::size_t>(op_.nodes()), Block::Zero());
        if (given_ && given.size() != P * P * op_.nodes())
            throw std::invalid_argument("tangential_stiffness must have " +
                                        std::to_string(P * P * op_.nodes()) + " entries, not " +
                                        std::to_string(given.size()));
        if constexpr (P > 0)
            for (Index i = 0; i < op_.nodes(); ++i) {
                Block &block = blocks_[static_cast<std::size_t>(i)];
                if (!given_) {
                    block = op_.W().template block<D>(i, i).template topLeftCorner<P, P>();
                    continue;
                }
                block = Eigen::Map<const Block>(given.data() + P * P * i);
                if (!(block.diagonal().minCoeff() > 0.0) || !block.allFinite())
                    throw std::invalid_argument(
                        "tangential_stiffness must be finite, its diagonals positive");
            }
    }

    Left measure(Solution &s, const VectorXl &w, const VectorXd &size) const {
        s.status.resize(static_cast<std::size_t>(op_.nodes()));
        Sums sums;
        std::visit(
            [&](const auto &source) {
                for (Index i = 0; i < op_.nodes(); ++i) {
                    const auto &law = source(static_cast<std::size_t>(i));
                    constexpr int L = std::decay_t<decltype(law)>::tangents; // 0 without friction
                    ExactState<L> at;
                    at.r =
                        s.reaction.segment<D>(D * i).template tail<L + 1>().template cast<Real>();
                    at.w.template head<L>() = w.segment<L>(D * i);
                    at.w[L] = w[D * i + P];
                    judge_exactly(law, kappa_[i], at);
                    s.status[static_cast<std::size_t>(i)] = at.branch;
                    if (at.branch == Branch::open && at.r.isZero(0.0L))
                        continue; // no terms that cancel
                    Sums contact;
                    contact.law = at.defect.squaredNorm();
                    add_sizes(law, i, at, size.segment<D>(D * i), contact);
                    const Real moved = kappa_[i] * kappa_[i] * at.w.squaredNorm();
                    sums.add(contact, std::max(at.r.squaredNorm(), moved));
                }
            },
            law_);
        for (Index c = 0, row = D * op_.nodes(); c < op_.tied(); ++c, ++row) {
            const Real force = tied_[c] * w[row], terms = tied_[c] * size[row];
            sums.law += force * force;
            sums.size += terms * terms;
        }
        const auto root = [](Real x) { return static_cast<double>(std::sqrt(x)); };
        return {root(sums.law), root(sums.slip), root(sums.size), root(sums.slip_size),
                root(sums.local)};
    }

    struct Sums {
        Real law = 0.0L, slip = 0.0L, size = 0.0L, slip_size = 0.0L; // squares
        Real local = 0.0L; // the largest of a contact over its own scale

        void add(const Sums &contact, Real scale) {
            law += contact.law;
            slip += contact.slip;
            size += contact.size;
            slip_size += contact.slip_size;
            for (const auto &[left, terms] :
                 {std::pair(contact.law, contact.size), std::pair(contact.slip, contact.slip_size)})
                if (left > local_rounding * local_rounding * terms)
                    local = std::max(local, left / scale);
        }
    };

    /// What cancels at a contact, component by component, and its slip defect as a force.
    template <class Law, int L = Law::tangents>
    void add_sizes(const Law &law, Index i, const ExactState<L> &at,
                   const Eigen::Matrix<double, D, 1> &size, Sums &sums) const {
        Real dual2 = 0.0L;
        for (int c = 0; c < L; ++c) {
            const Real q2_w = law.q2(c) * static_cast<Real>(size[c]), dual = law.mu(c) * q2_w;
            const Real terms = std::abs(at.r[c]) + kappa_[i] * q2_w;
            sums.size += terms * terms;
            dual2 += dual * dual;
        }
        const Real terms = std::abs(at.r[L]) + kappa_[i] * (size[P] + std::sqrt(dual2));
        sums.size += terms * terms;
        if constexpr (L > 0) {
            if (law.mu(0) == 0.0 || at.r.isZero(0.0L))
                return;
            const Block &block = blocks_[static_cast<std::size_t>(i)];
            const Eigen::Matrix<Real, L, 1> slip = at.slip,
                                            moved = size.template head<L>().template cast<Real>();
            const Eigen::Matrix<Real, L, L> K = block.template cast<Real>();
            if (given_) {
                sums.slip += (K * slip).squaredNorm();
                sums.slip_size += (K.cwiseAbs() * moved).squaredNorm();
                return;
            }
            const Real length2 = slip.squaredNorm();
            if (length2 > 0.0L) {
                const Real along = std::abs(slip.dot(K * slip)) / length2;
                const Real compliance = std::max<Real>(along, floor_);
                sums.slip += length2 / (compliance * compliance);
            }
            for (int c = 0; c < L; ++c) {
                const Real force = moved[c] / std::max<Real>(std::abs(K(c, c)), floor_);
                sums.slip_size += force * force;
            }
        }
    }

    const Operator &op_;
    const AnyLaw<P> &law_;
    const VectorXd &q_;
    double external_, tol_, floor_ = 0.0, load_ = 0.0;
    bool given_, acts_;
    VectorXd kappa_, tied_;
    std::vector<Block> blocks_; // tangential stiffness, or compliance if none is given
};
} // namespace dolfinx_contact::condensed
