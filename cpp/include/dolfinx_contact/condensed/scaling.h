// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file scaling.h
/// From a problem in physical variables to a System in scaled ones, and back.
#pragma once

#include "system.h"

namespace dolfinx_contact::condensed {
/// P tangential directions, T of them with friction (T = P or 0).
template <int T, int P> class Scaling {
  public:
    static constexpr int D = T + 1;

    Scaling(const Operator &op, const AnyLaw<P> &law, const VectorXd &q, const Poll &poll)
        : op_(op), q_(q), poll_(poll), coefficients_(law, op.nodes()) {
        set_length(free_length());
    }

    Index nodes() const { return op_.nodes(); }
    Index tied() const { return op_.tied(); }
    Index size() const { return D * op_.nodes() + op_.tied(); }
    auto contact_part(const VectorXd &v) const { return v.head(D * op_.nodes()); }

    /// Makes the largest of scaled reactions the unit of force, if it is not zero: a better one
    /// than what the free state on a soft spring would give. Units scale variables and starts; no
    /// error has them.
    VectorXd make_unit(const VectorXd &r) {
        const double largest = contact_part(r).template lpNorm<Eigen::Infinity>();
        if (!(largest > 0.0))
            return r;
        set_length(length_ * largest);
        return r / largest;
    }

    /// Physical reactions of P + 1 components in scaled variables.
    VectorXd scaled(const VectorXd &reaction) const {
        VectorXd r(D * op_.nodes() + op_.tied());
        for (Index i = 0; i < op_.nodes(); ++i)
            r.template segment<D>(D * i) =
                reaction.template segment<P + 1>((P + 1) * i).template tail<D>();
        r.tail(op_.tied()) = reaction.tail(op_.tied());
        return r.cwiseQuotient(make().right);
    }
    VectorXd physical(const System<T> &system, const VectorXd &r) const {
        VectorXd reaction = VectorXd::Zero(q_.size());
        const VectorXd unscaled = system.right.cwiseProduct(r);
        for (Index i = 0; i < op_.nodes(); ++i)
            reaction.segment<P + 1>((P + 1) * i).template tail<D>() =
                unscaled.template segment<D>(D * i);
        reaction.tail(op_.tied()) = unscaled.tail(op_.tied());
        return reaction;
    }

    /// The problem with mu over its mean of all directions to the power `friction`, and with p / mu
    /// to the power `rule`.
    System<T> make(double friction = 1.0, double rule = 1.0) const {
        System<T> system;
        system.nodes = op_.nodes();
        system.tied = op_.tied();
        system.W = T == P ? &op_.W() : &op_.normal();
        system.inverse = T == P ? op_.inverse() : nullptr;
        system.poll = &poll_;
        const Index size = system.size();
        system.left.resize(size);
        system.right.resize(size);
        system.q.resize(size);
        system.smooth.assign(static_cast<std::size_t>(op_.nodes()), T == 0);
        for (Index i = 0; i < op_.nodes(); ++i) {
            if constexpr (T > 0) {
                const bool smooth = !(coefficients_.mu(i, 0) > 0.0);
                system.smooth[static_cast<std::size_t>(i)] = smooth;
                for (int c = 0; c < T; ++c) {
                    const double mu = smooth ? 1.0 : bent(i, c, friction);
                    system.right[D * i + c] = mu * force_;
                    system.left[D * i + c] = mu * std::pow(coefficients_.q2(i, c), rule) / length_;
                    system.q[D * i + c] = q_[(P + 1) * i + c];
                }
            }
            system.right[D * i + T] = force_;
            system.left[D * i + T] = 1.0 / length_;
            system.q[D * i + T] = q_[(P + 1) * i + P];
        }
        for (Index c = 0; c < op_.tied(); ++c) {
            system.right[D * op_.nodes() + c] = tied_scale(c) * force_;
            system.left[D * op_.nodes() + c] = tied_scale(c) / length_;
            system.q[D * op_.nodes() + c] = q_[(P + 1) * op_.nodes() + c];
        }
        set_own(system);
        if (unlike(system.own))
            even_out(system);
        system.set_metric();
        return system;
    }

  private:
    /// mu with its ratio to the mean of all directions to a power.
    double bent(Index i, int c, double power) const {
        const double mu = coefficients_.mu(i, c);
        if (power == 1.0)
            return mu;
        const double mean = std::exp(coefficients_.mu.row(i).log().mean());
        return mean * std::pow(mu / mean, power);
    }
    void set_own(System<T> &system) const {
        const double mean = op_.mean_normal(), least = Tuning::negligible * mean;
        const VectorXd diagonal = op_.W().diagonal();
        system.own.resize(op_.nodes());
        for (Index i = 0; i < op_.nodes(); ++i) {
            const double own = diagonal[(P + 1) * i + P];
            system.own[i] = own > least ? own : mean;
        }
    }
    static bool unlike(const VectorXd &own) {
        return own.size() > 0 && own.maxCoeff() > Tuning::unlike * own.minCoeff();
    }
    /// Units of each contact, in which all have the same normal compliance: else those that are
    /// soft or bear little hardly count beside others.
    void even_out(System<T> &system) const {
        for (Index i = 0; i < op_.nodes(); ++i) {
            const double unit = std::sqrt(op_.mean_normal() / system.own[i]);
            system.left.template segment<D>(D * i) *= unit;
            system.right.template segment<D>(D * i) *= unit;
        }
    }
    void set_length(double length) {
        const double compliance = op_.mean_normal();
        length_ = length > 0.0 ? length : 1.0;
        force_ = compliance > 0.0 ? length_ / compliance : length_;
    }
    /// Largest load displacement.
    double free_length() const {
        double length = 0.0;
        for (Index i = 0; i < op_.nodes(); ++i) {
            Local<P> loaded = q_.segment<P + 1>((P + 1) * i);
            loaded[P] = std::min(loaded[P], 0.0);
            length = std::max(length, loaded.stableNorm());
        }
        for (Index c = 0; c < op_.tied(); ++c)
            length = std::max(length, std::abs(q_[(P + 1) * op_.nodes() + c]) * tied_scale(c));
        return length;
    }
    /// The factor that makes rows and columns of tied rows as large as those of contacts.
    double tied_scale(Index c) const {
        const double compliance = op_.mean_normal();
        return (compliance > 0.0 ? compliance : 1.0) / op_.largest_in_tied_row(c);
    }

    const Operator &op_;
    const VectorXd &q_;
    const Poll &poll_;
    Coefficients<P> coefficients_;
    double length_ = 1.0, force_ = 1.0;
};
} // namespace dolfinx_contact::condensed
