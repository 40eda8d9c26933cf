// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed.h
/// solve_condensed: the contact problem w = q + W r on plain arrays, by Newton's method and, where
/// that fails, a cascade of fallbacks.
#pragma once

#include "condensed_fixed_point.h"
#include "condensed_judge.h"
#include "condensed_scaling.h"
#include "condensed_starts.h"
#include <functional>

namespace dolfinx_contact::condensed {
/// What a caller may choose.
struct Options {
    double tol = 1e-8;      ///< largest error of a solution
    double slip_tol = 1e-8; ///< largest slip error of a solution
    double max_seconds = std::numeric_limits<double>::infinity();
    int max_iterations = 200'000; ///< Newton and fixed-point iterations of all attempts
    int newton_iterations = 60;   ///< Newton iterations of one attempt
    bool fallbacks = true;
    Scales scales = {};
};

/// The solver of one problem: P tangential directions, T of them with friction (T = P or 0).
template <int T, int P> class Cascade {
  public:
    Cascade(const Operator &op, const AnyLaw<P> &law, const VectorXd &q, const Options &options)
        : op_(op), q_(q), options_(options),
          judge_(op, law, q, options.scales, std::min(options.tol, options.slip_tol)),
          scaling_(op, law, q) {
        budget_.max_seconds = options.max_seconds;
        budget_.max_iterations = options.max_iterations;
    }

    Solution run(const std::vector<VectorXd> &starts) {
        best_.reaction = VectorXd::Zero(q_.size());
        best_.tied = op_.tied();
        judge_.judge(best_);
        if (best_.error <= best_.rounding) { // nothing presses: zero reactions are the answer
            best_.change = 0.0;
            best_.converged = true;
            best_.branch = "free";
        } else {
            search(starts);
        }
        best_.iterations = budget_.iterations;
        best_.seconds = budget_.seconds();
        return best_;
    }

  private:
    void search(const std::vector<VectorXd> &starts) {
        const VectorXd given = scaling_.make_unit(nearest(starts));
        const VectorXd zero = VectorXd::Zero(scaling_.size());
        const auto newton = [this](VectorXd r, double normal, double tangential) {
            return [this, r, normal, tangential]() mutable {
                System<T> system = scaling_.make();
                system.set_metric(normal, tangential);
                finish(system, r);
            };
        };
        if (attempt("newton", newton(given, 10.0, 1.0)) || !options_.fallbacks)
            return;
        if (!given.isZero(0.0) && attempt("newton from zero", newton(zero, 10.0, 1.0)))
            return;
        for (const auto &[normal, tangential] :
             {std::pair{1.0, 0.1}, {1.0, 1.0}, {100.0, 10.0}, {10.0, 10.0}, {0.1, 0.1}})
            if (attempt("newton, other metric", newton(given, normal, tangential)))
                return;
        const auto path = [this, &zero](auto change) {
            return [this, change, &zero] {
                VectorXd r = zero;
                if (follow(r, change)) {
                    System<T> system = scaling_.make();
                    system.set_metric(10.0, 1.0);
                    finish(system, r);
                }
            };
        };
        if (T > 0 && !scaling_.associated() &&
            attempt("continuation in p", path([](Path &at, double s) { at.rule = s; })))
            return;
        if (attempt("fixed point", [this, zero] {
                VectorXd r = zero;
                System<T> system = scaling_.make();
                system.set_metric(1.0, 1.0);
                fixed_point(system, r, 1e-6, 400, budget_);
                system.set_metric(10.0, 1.0);
                finish(system, r);
            }))
            return;
        if (attempt("homotopy in the load", path([](Path &at, double s) { at.load = s; })))
            return;
        if (T > 0 &&
            attempt("continuation in mu", path([](Path &at, double s) { at.friction = s; })))
            return;
        attempt("random starts", [this, &newton] {
            // Solutions that no path leads to: from anywhere, and from near the best state so far.
            std::minstd_rand random(1);
            const auto size = static_cast<double>(scaling_.size());
            const int starts = static_cast<int>(std::min(3000.0, 4e6 / (size * size)));
            for (int k = 0; k < starts && !best_.converged && !budget_.spent(); ++k)
                newton(k % 2 == 0 ? start_near(random, scaling_.scaled(best_.reaction))
                                  : random_start<T>(random, op_.nodes(), op_.tied()),
                       k % 3 == 1 ? 1.0 : 10.0, k % 3 == 2 ? 0.1 : 1.0)();
        });
    }

    /// The start of the smallest residual, scaled; zero is always one.
    VectorXd nearest(const std::vector<VectorXd> &starts) const {
        System<T> system = scaling_.make();
        system.set_metric(10.0, 1.0);
        State<T> state;
        VectorXd best = VectorXd::Zero(system.size());
        state.evaluate(system, best, system.displacement(best));
        double smallest = state.merit;
        for (const VectorXd &start : starts) {
            const VectorXd r = scaling_.scaled(start);
            state.evaluate(system, r, system.displacement(r));
            if (state.merit < smallest) {
                smallest = state.merit;
                best = r;
            }
        }
        return best;
    }

    /// Newton's method to the tolerance, judged on physical reactions; keeps the best state.
    void finish(System<T> &system, VectorXd &r) {
        const auto certified = [&](const VectorXd &mapped) {
            Solution found;
            found.reaction = scaling_.physical(system, mapped);
            found.tied = op_.tied();
            judge_.judge(found);
            system.accurate = found.near_rounding;
            found.converged = Judge<P>::accepts(found, options_.tol, options_.slip_tol);
            if (found.converged || worst(found) < worst(best_)) {
                found.tried = std::move(best_.tried);
                best_ = std::move(found);
            }
            return best_.converged;
        };
        const double target = 1e3 * std::min(options_.tol, options_.slip_tol);
        Newton<T> newton(system);
        if (newton.solve(r, target, budget_, options_.newton_iterations, certified) ==
            End::converged) {
            const VectorXd change = system.right.cwiseProduct(newton.next_change(r));
            best_.change = scaling_.contact_part(change).norm() / best_.acting;
        } else {
            State<T> state;
            state.evaluate(system, r, system.displacement(r));
            certified(state.mapped());
        }
    }
    static double worst(const Solution &s) { return std::max(s.error, s.slip_error); }

    /// Follows the solution from s = 0 to 1, steps halved on failure and doubled after success.
    bool follow(VectorXd &r, const std::function<void(Path &, double)> &change) {
        double reached = -1.0, step = 0.25;
        VectorXd before;
        double reached_before = -1.0;
        constexpr double shortest = 1e-4;
        const int last_iteration = budget_.iterations + 2000;
        for (int failures = 0; reached < 1.0;) {
            const double s = reached < 0.0 ? 0.0 : std::min(1.0, reached + step);
            Path at;
            change(at, s);
            System<T> system = scaling_.make(at);
            system.set_metric(10.0, 1.0);
            VectorXd trial = r;
            if (before.size() > 0 && failures == 0)
                trial += (s - reached) / (reached - reached_before) * (r - before);
            const End end =
                Newton<T>(system).solve(trial, 1e-6, budget_, options_.newton_iterations,
                                        [](const VectorXd &) { return true; });
            if (end == End::converged) {
                if (reached >= 0.0) {
                    before = r;
                    reached_before = reached;
                    step *= 2.0;
                }
                r = trial;
                reached = s;
                failures = 0;
            } else {
                step *= 0.5;
                ++failures;
                if (step < shortest || reached < 0.0 || budget_.spent() ||
                    budget_.iterations >= last_iteration)
                    return false;
            }
        }
        return true;
    }

    template <class Try> bool attempt(const char *name, Try &&action) {
        if (budget_.spent())
            return true;
        const int iterations = budget_.iterations;
        const double seconds = budget_.seconds();
        action();
        best_.tried.push_back({name, best_.converged, budget_.iterations - iterations,
                               budget_.seconds() - seconds, best_.error, best_.slip_error});
        if (best_.converged)
            best_.branch = name;
        return best_.converged;
    }

    const Operator &op_;
    const VectorXd &q_;
    Options options_;
    Judge<P> judge_;
    Scaling<T, P> scaling_;
    Budget budget_;
    Solution best_;
};

/// Solves w = q + W r with the law between r and w at every contact.
///
/// Component order per contact: T tangential, then the normal one; w_n is the gap, w_t the slip.
/// W may be rank-deficient and slightly unsymmetric. Rows after those of contacts are tied: w_c =
/// 0. The errors, with S the larger of |r|, Euclidean over all contacts, and `external` (where |r|
/// is above the load |kappa (q_t, min(q_n, 0))|, that counts instead):
/// - error: |(r - proj(r - kappa (Q^2 w_t, w_n + |M Q^2 w_t|), K_mu), kappa_c w_c)| / S, Euclidean
///   over all contacts and tied rows, kappa by default 1 / W_nn;
/// - slip_error: |kappa_t (w_t + |w_t| d)| / S, Euclidean over slipping contacts, |kappa_t w_t| on
///   sticking ones, kappa_t by default 1 / W along the defect;
/// - rounding: eps times the size of the terms that cancel in them, over S.
///
/// T = 0 is contact without friction on normal components alone.
/// @param starts reactions to start from; the one of the smallest residual is taken
template <int T>
Solution solve(const Operator &op, const AnyLaw<T> &law, const VectorXd &q,
               const std::vector<VectorXd> &starts, const Options &options) {
    if (T == 0 || Coefficients<T>(law, op.nodes()).frictionless())
        return Cascade<0, T>(op, law, q, options).run(starts);
    return Cascade<T, T>(op, law, q, options).run(starts);
}
} // namespace dolfinx_contact::condensed
