// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_attempts.h
/// The methods of the cascade, each ended by the judge, and the best state that they found.
#pragma once

#include "condensed_feasibility.h"
#include "condensed_interior.h"
#include "condensed_judge.h"
#include "condensed_path.h"
#include "condensed_plane.h"
#include "condensed_proximal.h"
#include "condensed_scaling.h"
#include "condensed_splitting.h"
#include "condensed_starts.h"
#include <utility>

namespace dolfinx_contact::condensed {
/// Methods that come from zero to where Newton's method may start, and where they are.
template <int T> struct Wandering {
    static constexpr double rho = 0.3; // of alternating directions that do not converge
    Sweeps<T> sweeps;
    Splitting<T> splitting;
    VectorXd swept;
    std::minstd_rand random{1};
    int rounds = 0;
    // the smallest errors that Newton's method left from there
    double least_swept = std::numeric_limits<double>::infinity(), least_split = least_swept;

    explicit Wandering(const System<T> &system)
        : sweeps(system), splitting(system, rho), swept(VectorXd::Zero(system.size())) {}
};

/// P tangential directions, T of them with friction (T = P or 0).
template <int T, int P> class Attempts {
  public:
    Attempts(const Operator &op, const AnyLaw<P> &law, const VectorXd &q, const Options &options)
        : op_(op), q_(q), options_(options),
          judge_(op, law, q, options.scales, std::min(options.tol, options.slip_tol)),
          scaling_(op, law, q) {}

  protected:
    static constexpr int patience = 40; // of the proximal point method, where it is given its time

    /// Whether scaled reactions are a solution; keeps the best state.
    bool certify(System<T> &system, const VectorXd &mapped) {
        Solution found;
        found.reaction = scaling_.physical(system, mapped);
        found.tied = op_.tied();
        judge_.judge(found);
        last_error_ = worst(found);
        system.accurate = found.near_rounding;
        found.converged = Judge<P>::accepts(found, options_);
        if (found.converged || worst(found) < worst(best_)) {
            found.tried = std::move(best_.tried);
            best_ = std::move(found);
        }
        return best_.converged;
    }
    /// By how much Newton's next step would move reactions. Where that is much it is taken if it
    /// leaves smaller errors; of a sparse W, the factors of which cost far more than the step.
    void set_change(Newton<T> &newton, System<T> &system, const VectorXd &r) {
        const VectorXd next = newton.next(r),
                       change = system.right.cwiseProduct(next - newton.mapped());
        best_.change = scaling_.contact_part(change).norm() / best_.acting;
        if (system.pattern == nullptr || !best_.converged || best_.change <= options_.tol)
            return;
        const Solution before = best_;
        State<T> state;
        state.evaluate(system, next, system.displacement(next));
        certify(system, state.mapped());
        if (worst(before) < worst(best_))
            best_ = before;
        best_.change = before.change;
    }

    /// Newton's method to the tolerance, judged on physical reactions.
    void finish(System<T> &system, VectorXd &r) { finish(system, r, options_.newton_iterations); }
    void finish(System<T> &system, VectorXd &r, int iterations) {
        const auto certified = [&](const VectorXd &mapped) { return certify(system, mapped); };
        const double target = 1e3 * std::min(options_.tol, options_.slip_tol);
        Newton<T> newton(system);
        if (newton.solve(r, target, budget_, iterations, certified) == End::converged) {
            set_change(newton, system, r);
        } else {
            State<T> state;
            state.evaluate(system, r, system.displacement(r));
            if (certified(state.mapped()))
                set_change(newton, system, r);
        }
    }

    /// All states that one contact can be in.
    void one_contact() {
        System<T> system = scaling_.make();
        using Exact = Nodal<T, Real>;
        const typename Exact::Matrix A =
            system.left.template cast<Real>().asDiagonal() *
            system.W->template block<T + 1>(0, 0).template cast<Real>() *
            system.right.template cast<Real>().asDiagonal();
        const typename Exact::Vector q =
            system.left.template cast<Real>().cwiseProduct(system.q.template cast<Real>());
        ++budget_.iterations;
        for (const auto &r : Exact(A, system.smooth[0]).candidates(q))
            if (certify(system, r.template cast<double>())) {
                Newton<T> newton(system);
                return set_change(newton, system, r.template cast<double>());
            }
    }

    /// With rho_t times `tangential`: Newton's method goes around in circles elsewhere then.
    void newton(VectorXd r, double tangential = 1.0) {
        System<T> system = scaling_.make();
        system.rho_t *= tangential;
        finish(system, r);
    }

    /// Newton's method after a few alternating directions, while these come nearer to a solution.
    /// Where factors have few entries only at first: an iteration is not much cheaper there than
    /// one with new factors.
    void near() {
        constexpr int iterations = 15, few = 8, most = 10;
        constexpr double close_at_once = 1.5e-2, close = 1e-3, far = 0.3, faster = 0.7,
                         filled = 0.1;
        constexpr double rho = 0.03; // small ones are quickest where all goes well
        System<T> system = scaling_.make();
        Splitting<T> splitting(system, rho);
        double limit = far;
        for (int k = 0; k < most && (k == 0 || splitting.fill() > filled); ++k, limit *= faster) {
            splitting.run(0.0, iterations, budget_);
            VectorXd r = splitting.reactions();
            State<T> state;
            state.evaluate(system, r, system.displacement(r));
            const double left = std::sqrt(2.0 * state.merit) / r.norm();
            if (left < (k == 0 ? close_at_once : close))
                return finish(system, r, few);
            if (!(left < limit))
                return;
        }
    }

    /// Newton's method from the end of the interior point method, which is returned.
    VectorXd interior() {
        const System<T> system = scaling_.make();
        VectorXd r = InteriorPoint<T>(system).run(budget_);
        newton(r);
        return r;
    }

    /// Newton's method from the end of a path that starts at the best state, and the proximal point
    /// method from there.
    void path() {
        if constexpr (T > 0) {
            const System<T> system = scaling_.make();
            const VectorXd r = scaling_.scaled(best_.reaction);
            std::minstd_rand random(1);
            if (r.isZero(0.0) || system.q.isZero(0.0))
                return;
            Path<T> path(system, r, random, budget_);
            if (!path.run())
                return;
            newton(path.reactions());
            if (!best_.converged)
                proximal_from(path.reactions());
        }
    }

    /// Newton's method from where sweeps come to from r, and the proximal point method from there.
    void swept(VectorXd r, int sweeps) {
        System<T> system = scaling_.make();
        Sweeps<T>(system).run(r, 1e-6, sweeps, budget_);
        newton(r);
        if (!best_.converged)
            proximal_from(r);
    }

    /// Newton's method after every 500 sweeps in an order of chance, and after every 500 iterations
    /// of alternating directions: where these do not converge, they come by chance to where
    /// Newton's method does. The one that is far behind has every tenth round. Sweeps begin anew
    /// every 40 rounds.
    void by_turns(Wandering<T> &at, int rounds) {
        constexpr int iterations = 500, rounds_of_start = 40, seldom = 10;
        constexpr double target = 1e-9, behind = 10.0;
        const auto turn = [&](double error, double other) {
            return !best_.converged && !budget_.spent() &&
                   (error <= behind * other || at.rounds % seldom == 0);
        };
        const auto finish_from = [&](const VectorXd &r, double &least) {
            const double before = worst(best_);
            newton(r);
            least = std::min(least, last_error_);
            for (const double tangential : {3.0, 0.3}) // from a better state than ever before
                if (!best_.converged && worst(best_) < before)
                    newton(scaling_.scaled(best_.reaction), tangential);
        };
        for (int k = 0; k < rounds; ++k, ++at.rounds) {
            if (turn(at.least_swept, at.least_split)) {
                if (at.rounds % rounds_of_start == 0)
                    at.swept.setZero();
                at.sweeps.run(at.swept, target, iterations, budget_, &at.random);
                if (!at.swept.isZero(0.0)) // sweeps apply
                    finish_from(at.swept, at.least_swept);
            }
            if (turn(at.least_split, at.least_swept)) {
                at.splitting.run(target, iterations, budget_);
                finish_from(at.splitting.reactions(), at.least_split);
            }
        }
    }

    /// The proximal point method from r, the errors those of the problem itself, until so many of
    /// its steps in a row were in vain.
    void proximal_from(VectorXd r, int in_vain = patience) {
        System<T> system = scaling_.make();
        system.inverse = nullptr;
        const auto error = [&](const VectorXd &mapped) {
            last_error_ = 0.0;
            return certify(system, mapped) ? 0.0 : last_error_;
        };
        if (!proximal(system, r, op_.mean_normal(), in_vain, budget_, error))
            return;
        Newton<T> newton(system);
        set_change(newton, system, r);
    }

    /// Whether contacts close whatever the reactions are. A body has a regular W, and no such
    /// contacts.
    void feasibility() {
        if (op_.tied() > 0 || op_.inverse() != nullptr)
            return;
        const VectorXd q_n = q_(Eigen::seqN(Index{P}, op_.nodes(), Index{P + 1}));
        const VectorXd forces = closing_forces(op_, q_n, budget_);
        if (judge_.excludes(forces, std::max(options_.tol, options_.slip_tol))) {
            best_.unsolvable = true;
            best_.closing = forces / forces.maxCoeff();
        }
    }

    /// Contacts in the plane: complementary pivots; of a few contacts every state.
    void in_the_plane() {
        if constexpr (T == 1 && P == 1) {
            constexpr int covers = 20;
            constexpr Index few = 5;
            System<T> system = scaling_.make();
            const Plane plane(system);
            std::minstd_rand random(1);
            const auto accept = [&](const VectorXd &r) {
                if (r.size() == 0 || !certify(system, r))
                    return false;
                Newton<T> newton(system);
                set_change(newton, system, r);
                return true;
            };
            for (int k = 0; k < covers && !budget_.spent(); ++k, ++budget_.iterations) {
                VectorXl cover = VectorXl::Ones(3 * op_.nodes());
                for (Index i = 0; i < cover.size() && k > 0; ++i)
                    cover[i] = power_of_ten(random, -0.5, 0.5);
                if (accept(plane.pivots(cover, options_.heed)))
                    return;
            }
            if (op_.nodes() <= few)
                best_.unsolvable = !plane.all_states(accept);
        }
    }
    double worst(const Solution &s) const {
        return std::isfinite(options_.local_tol) ? s.local_error : std::max(s.error, s.slip_error);
    }

    /// Newton's method at the end of a path of solutions from an easier problem, solved from a
    /// random start: there contacts give way more, by `shift` times the mean compliance, friction
    /// is that of the mean coefficient, the slip rule is associated, or some of these. Steps are
    /// halved where Newton's method fails and doubled where it does not.
    void follow(std::minstd_rand &random) {
        constexpr double shortest = 1e-3, longest = 0.5;
        const double shift = uniform(random) < 0.2 ? 0.0 : power_of_ten(random, -1.0, 1.5);
        const bool friction = uniform(random) < 0.7;
        VectorXd r = random_start<T>(random, op_.nodes(), op_.tied()), before;
        double reached = 0.0, reached_before = 0.0, step = 0.25;
        const auto solved = [&](double s, VectorXd &trial) {
            System<T> system = scaling_.make(friction ? s : 1.0, s);
            system.shift = (1.0 - s) * shift * op_.mean_normal();
            if (s == 1.0)
                finish(system, trial);
            return s == 1.0
                       ? best_.converged
                       : Newton<T>(system).solve(trial, 1e-6, budget_, options_.newton_iterations,
                                                 [](const VectorXd &) { return true; }) ==
                             End::converged;
        };
        if (!solved(0.0, r))
            return;
        while (reached < 1.0 && step >= shortest && !budget_.spent()) {
            const double s = std::min(1.0, reached + step);
            VectorXd trial = r;
            if (before.size() > 0)
                trial += (s - reached) / (reached - reached_before) * (r - before);
            bool found = solved(s, trial);
            if (!found && before.size() > 0) {
                trial = r;
                found = solved(s, trial);
            }
            if (found) {
                before = std::exchange(r, trial);
                reached_before = std::exchange(reached, s);
                step = std::min(longest, 2.0 * step);
            } else
                step *= 0.5;
        }
    }

    template <class Try> bool attempt(const char *name, Try &&action) {
        if (budget_.spent())
            return true;
        const auto &without = options_.without;
        if (std::find(without.begin(), without.end(), name) != without.end())
            return false;
        const int iterations = budget_.iterations;
        const double seconds = budget_.seconds();
        action();
        constexpr std::array forms{"", ", metric between", ", units of contacts"};
        const std::string branch =
            std::string(name) + forms[static_cast<std::size_t>(scaling_.form())];
        best_.tried.push_back({branch, best_.converged, budget_.iterations - iterations,
                               budget_.seconds() - seconds, best_.error, best_.slip_error});
        if (best_.converged)
            best_.branch = branch;
        return best_.converged;
    }

    const Operator &op_;
    const VectorXd &q_;
    const Options &options_;
    Judge<P> judge_;
    Scaling<T, P> scaling_;
    Budget budget_{options_};
    Solution best_;
    double last_error_ = 0.0; // of the state certified last
};
} // namespace dolfinx_contact::condensed
