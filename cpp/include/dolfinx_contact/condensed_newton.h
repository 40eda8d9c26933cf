// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_newton.h
/// Globalised semismooth Newton method for the condensed contact problem.
#pragma once

#include "condensed_direction.h"
#include "condensed_solution.h"
#include <chrono>
#include <deque>

namespace dolfinx_contact::condensed {
/// Why an attempt ended.
enum class End { converged, line_search, stalled, iterations, seconds, not_finite };

/// Iterations and seconds that all attempts share.
struct Budget {
    using Clock = std::chrono::steady_clock;
    const Options &options;
    Clock::time_point start = Clock::now();
    int iterations = 0;

    double seconds() const { return std::chrono::duration<double>(Clock::now() - start).count(); }
    bool late() const { return seconds() >= options.max_seconds; }
    /// Asked in every iteration, so the place where others may end them.
    bool spent() const {
        if (options.heed)
            options.heed();
        return iterations >= options.max_iterations || late();
    }

    /// The iterate r for who wants to see it, its residual over the largest reaction or one.
    template <int T> void tell(const State<T> &state, const VectorXd &r) const {
        if (!options.monitor)
            return;
        std::array<int, 3> counts{};
        for (const auto &point : state.points)
            ++counts[static_cast<std::size_t>(point.branch)];
        options.monitor(std::sqrt(2.0 * state.merit) /
                            std::max(1.0, r.template lpNorm<Eigen::Infinity>()),
                        counts);
    }
};

/// Newton's method on the residual of a System with a nonmonotone line search
/// [L. Grippo, F. Lampariello, S. Lucidi, SIAM J. Numer. Anal. 23 (1986)].
template <int T> class Newton {
  public:
    explicit Newton(const System<T> &system) : system_(system), direction_(system) {}

    /// Iterates from r until certified(r) holds for the reactions that the law returns. It is asked
    /// once the residual is below `target`, relative to the largest reaction or to one.
    template <class Certify>
    End solve(VectorXd &r, double target, Budget &budget, int max_iterations, Certify certified) {
        VectorXd w = system_.displacement(r), best = r;
        state_.evaluate(system_, r, w);
        std::deque<double> memory{state_.merit};
        double smallest = state_.merit;
        constexpr int patience = 12; // iterations without progress: it goes around in a circle
        for (int iteration = 0, in_vain = 0;; ++iteration, ++in_vain) {
            if (!std::isfinite(state_.merit)) {
                r = best;
                return End::not_finite;
            }
            budget.tell(state_, r);
            const double size = std::max(1.0, r.template lpNorm<Eigen::Infinity>());
            if (std::sqrt(2.0 * state_.merit) <= target * size && certified(state_.mapped()))
                return End::converged;
            if (iteration == max_iterations || budget.spent()) {
                r = best;
                return iteration < max_iterations && budget.late() ? End::seconds : End::iterations;
            }
            if (in_vain > patience) {
                r = best;
                return End::stalled;
            }
            ++budget.iterations;
            VectorXd dr, dw;
            direction_.find(state_, r, w, dr, dw);
            if (!line_search(r, w, dr, dw, *std::max_element(memory.begin(), memory.end()))) {
                r = best;
                return End::line_search;
            }
            if (std::sqrt(2.0 * state_.merit) <= target * size) { // without the rounding of steps
                w = system_.displacement(r);
                state_.evaluate(system_, r, w);
            }
            memory.push_back(state_.merit);
            if (memory.size() > 8)
                memory.pop_front();
            if (state_.merit < smallest) {
                smallest = state_.merit;
                best = r;
                in_vain = 0;
            }
        }
    }

    /// By how much the next step from r would move what the law returns there. After convergence
    /// with the factors of the last step where they still fit, which then costs no more than
    /// products with W.
    VectorXd next_change(const VectorXd &r) {
        const VectorXd w = system_.displacement(r);
        state_.evaluate(system_, r, w);
        VectorXd dr, dw;
        direction_.find(state_, r, w, dr, dw, true);
        return r + dr - state_.mapped();
    }

  private:
    bool line_search(VectorXd &r, VectorXd &w, const VectorXd &dr, const VectorXd &dw,
                     double reference) {
        constexpr double decrease = 1e-4, shortest = 1e-5;
        const double slope = 2.0 * state_.merit;
        State<T> trial;
        for (double length = 1.0; length >= shortest; length *= 0.5) {
            const VectorXd r_trial = r + length * dr, w_trial = w + length * dw;
            trial.evaluate(system_, r_trial, w_trial);
            if (trial.merit <= reference - decrease * length * slope) {
                r = r_trial;
                w = w_trial;
                std::swap(state_, trial);
                return true;
            }
        }
        return false;
    }

    const System<T> &system_;
    State<T> state_;
    Direction<T> direction_;
};
} // namespace dolfinx_contact::condensed
