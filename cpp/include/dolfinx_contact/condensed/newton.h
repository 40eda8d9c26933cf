// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file newton.h
/// Globalised semismooth Newton method for the condensed contact problem.
#pragma once

#include "budget.h"
#include "direction.h"
#include <deque>

namespace dolfinx_contact::condensed {
/// Newton's method on the residual of a System with a nonmonotone line search
/// [L. Grippo, F. Lampariello, S. Lucidi, SIAM J. Numer. Anal. 23 (1986)].
template <int T> class Newton {
  public:
    explicit Newton(const System<T> &system) : system_(system), direction_(system) {}

    /// Iterates from r until certified(r) holds for the reactions that the law returns. It is asked
    /// once the residual is below `target`, relative to the largest reaction or to one. Whether it
    /// does; else r is the iterate of the smallest residual.
    template <class Certify>
    bool solve(VectorXd &r, double target, Budget &budget, int max_iterations, Certify certified) {
        VectorXd &w = w_;
        VectorXd best = r;
        w = system_.displacement(r);
        at_.resize(0);
        state_.evaluate(system_, r, w);
        std::deque<double> memory{state_.merit};
        double smallest = state_.merit;
        for (int iteration = 0, in_vain = 0;; ++iteration, ++in_vain) {
            if (!std::isfinite(state_.merit)) {
                r = best;
                return false;
            }
            budget.tell(state_, r);
            const double size = std::max(1.0, r.template lpNorm<Eigen::Infinity>());
            if (std::sqrt(2.0 * state_.merit) <= target * size) {
                if (certified(state_.mapped())) {
                    at_ = r;
                    return true;
                }
                w = system_.displacement(r); // without the rounding of steps
                state_.evaluate(system_, r, w);
            }
            if (iteration == max_iterations || in_vain > Tuning::newton_patience ||
                budget.spent()) {
                r = best;
                return false;
            }
            ++budget.iterations;
            if (!advance(r, w, *std::max_element(memory.begin(), memory.end()))) {
                r = best;
                return false;
            }
            memory.push_back(state_.merit);
            if (memory.size() > Tuning::newton_memory)
                memory.pop_front();
            if (state_.merit < smallest) {
                smallest = state_.merit;
                best = r;
                in_vain = 0;
            }
        }
    }

    /// Where the next step from r leads. After convergence with the factors of the last step where
    /// they still fit, which then costs no more than products with W.
    VectorXd next(const VectorXd &r) {
        if (at_.size() == 0 || at_ != r) {
            w_ = system_.displacement(r);
            state_.evaluate(system_, r, w_);
        }
        VectorXd dr, dw;
        direction_.find(state_, r, w_, dr, dw, Direction<T>::Factors::last_for_change);
        return r + dr;
    }
    /// The reactions that the law returns there, before the step.
    VectorXd mapped() const { return state_.mapped(); }

  private:
    /// A step with the last factors, which costs two products with W, if the residual has fallen
    /// tenfold since they were made and falls as much again. Else one with factors of the present
    /// Jacobian, along which is searched.
    bool advance(VectorXd &r, VectorXd &w, double reference) {
        using Factors = typename Direction<T>::Factors;
        const bool near =
            direction_.worth_keeping() && state_.merit <= Tuning::kept_factors * factored_at_;
        VectorXd dr, dw;
        if (direction_.find(state_, r, w, dr, dw, near ? Factors::last : Factors::present)) {
            if (try_step(r, w, dr, dw, 1.0, Tuning::kept_factors * state_.merit))
                return true;
            direction_.find(state_, r, w, dr, dw);
        }
        factored_at_ = state_.merit;
        return line_search(r, w, dr, dw, reference);
    }
    /// Takes the step if its merit is no larger than `most`.
    bool try_step(VectorXd &r, VectorXd &w, const VectorXd &dr, const VectorXd &dw, double length,
                  double most) {
        const VectorXd r_trial = r + length * dr, w_trial = w + length * dw;
        trial_.evaluate(system_, r_trial, w_trial);
        if (!(trial_.merit <= most))
            return false;
        r = r_trial;
        w = w_trial;
        std::swap(state_, trial_);
        return true;
    }

    bool line_search(VectorXd &r, VectorXd &w, const VectorXd &dr, const VectorXd &dw,
                     double reference) {
        const double slope = 2.0 * state_.merit;
        for (double length = 1.0; length >= Tuning::shortest_step; length *= 0.5)
            if (try_step(r, w, dr, dw, length, reference - Tuning::decrease * length * slope))
                return true;
        return false;
    }

    const System<T> &system_;
    State<T> state_, trial_;
    VectorXd at_, w_;          // reactions of the state after convergence, and displacement
    double factored_at_ = 0.0; // merit of the state that the last factors are of
    Direction<T> direction_;
};
} // namespace dolfinx_contact::condensed
