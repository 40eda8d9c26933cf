// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file search.h
/// The methods, in order, each ended by the judge; the best state that they found.
#pragma once

#include "homotopy.h"
#include "interior_point.h"
#include "judge.h"
#include "newton.h"
#include "proximal_point.h"
#include "scaling.h"
#include <algorithm>
#include <stdexcept>

namespace dolfinx_contact::condensed {
/// The solver of one problem: P tangential directions, T of them with friction (T = P or 0).
template <int T, int P> class Search {
    /// Where a method begins: at the start of the smallest residual, or where the last one ended.
    /// interior_point and homotopy begin at reactions of their own.
    enum class From { start, last };
    /// One row of the table: when it applies, iterations at most, where it begins, the augmentation
    /// parameter of tangential directions over the usual one, and what it runs, which returns where
    /// a method after it may begin.
    struct Method {
        const char *name;
        bool of_friction_alone;
        int iterations;
        From from;
        double rho_t;
        VectorXd (Search::*run)(System<T> &, const VectorXd &);
    };
    static std::array<Method, 5> methods() {
        return {{
            {"newton", false, Tuning::newton_most, From::start, 1.0, &Search::newton},
            {"newton, 3 rho_t", true, Tuning::newton_most, From::start, Tuning::stiffer,
             &Search::newton},
            {"interior_point", false, Tuning::interior_most, From::start, 1.0,
             &Search::interior_point},
            {"proximal_point", false, Tuning::proximal_most, From::last, 1.0, &Search::proximal},
            {"homotopy", false, Tuning::homotopy_most, From::start, 1.0, &Search::homotopy},
        }};
    }

  public:
    Search(const Operator &op, const AnyLaw<P> &law, const VectorXd &q, const Options &options)
        : op_(op), options_(options), budget_{options}, poll_([this] { budget_.poll(); }),
          judge_(op, law, q, options.scales, std::min(options.tol, options.slip_tol)),
          scaling_(op, law, q, poll_) {
        best_.reaction = VectorXd::Zero(q.size());
        best_.tied = op.tied();
        judge_.judge(best_);
    }
    Search(const Search &) = delete; // poll_ knows this one

    Solution run(const std::vector<VectorXd> &starts) {
        if (Judge<P>::reached(best_.error, 0.0, best_.rounding)) { // nothing presses
            best_.change = 0.0;
            best_.converged = true;
            best_.branch = "free";
        } else {
            try_methods(starts);
        }
        best_.iterations = budget_.iterations;
        best_.seconds = budget_.seconds();
        return best_;
    }

  private:
    void try_methods(const std::vector<VectorXd> &starts) {
        const VectorXd start = scaling_.make_unit(nearest(starts));
        const auto &without = options_.without;
        VectorXd last = start;
        for (const Method &method : methods()) {
            if (best_.converged || budget_.over())
                return;
            if ((method.of_friction_alone && T == 0) ||
                std::find(without.begin(), without.end(), method.name) != without.end())
                continue;
            last = attempt(method, method.from == From::last ? last : start);
            if (!options_.fallbacks)
                return;
        }
    }

    /// The start of the smallest residual, scaled; zero is always one.
    VectorXd nearest(const std::vector<VectorXd> &starts) const {
        const System<T> system = scaling_.make();
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

    VectorXd attempt(const Method &method, VectorXd r) {
        const int iterations = budget_.iterations;
        const double seconds = budget_.seconds();
        System<T> system = scaling_.make();
        system.rho_t *= method.rho_t;
        budget_.begin(std::max(method.iterations, options_.newton_iterations));
        try {
            r = (this->*method.run)(system, r);
        } catch (const OutOfTime &) { // the best state is what was found until then
        }
        best_.tried.push_back({method.name, best_.converged, budget_.iterations - iterations,
                               budget_.seconds() - seconds, best_.error, best_.slip_error});
        if (best_.converged)
            best_.branch = method.name;
        return r;
    }

    VectorXd newton(System<T> &system, const VectorXd &start) {
        VectorXd r = start;
        const auto certified = [&](const VectorXd &mapped) { return certify(system, mapped); };
        const double target = Tuning::judged_from * std::min(options_.tol, options_.slip_tol);
        Newton<T> newton(system);
        if (!newton.solve(r, target, budget_, options_.newton_iterations, certified)) {
            State<T> state;
            state.evaluate(system, r, system.displacement(r));
            certified(state.mapped());
        }
        if (best_.converged)
            set_change(newton, system, r);
        return r;
    }

    /// Newton's method from the end of the interior point method. Returns that end, where
    /// proximal_point may begin.
    VectorXd interior_point(System<T> &system, const VectorXd &) {
        VectorXd end = InteriorPoint<T>(system).run(budget_);
        newton(system, end);
        return end;
    }

    VectorXd proximal(System<T> &system, const VectorXd &start) {
        VectorXd r = start;
        system.inverse = nullptr;
        const auto error = [&](const VectorXd &mapped) {
            return certify(system, mapped) ? 0.0 : last_error_;
        };
        if (proximal_point(system, r, budget_, error)) {
            Newton<T> newton(system);
            set_change(newton, system, r);
        }
        return r;
    }

    /// From many easier problems and starts.
    VectorXd homotopy(System<T> &system, const VectorXd &start) {
        Random random;
        const auto finish = [&](VectorXd &r) {
            r = newton(system, r);
            return best_.converged;
        };
        const auto size = static_cast<double>(system.size());
        const int paths = std::clamp(static_cast<int>(Tuning::path_work / (size * size)),
                                     Tuning::fewest_paths, Tuning::most_paths);
        for (int k = 0; k < paths && !best_.converged && !budget_.spent(); ++k)
            Homotopy<T, P>(scaling_, budget_, random).run(finish);
        return start;
    }

    /// Whether scaled reactions are a solution; keeps the best state.
    bool certify(System<T> &system, const VectorXd &mapped) {
        Solution found;
        found.reaction = scaling_.physical(system, mapped);
        found.tied = op_.tied();
        judge_.judge(found);
        last_error_ = worst(found);
        system.accurate = found.near_rounding;
        found.converged = Judge<P>::accepts(found, options_);
        if (found.converged || last_error_ < worst(best_)) {
            found.tried = std::move(best_.tried);
            best_ = std::move(found);
        }
        return best_.converged;
    }
    double worst(const Solution &s) const {
        return std::isfinite(options_.local_tol) ? s.local_error : std::max(s.error, s.slip_error);
    }
    /// By how much Newton's next step would move reactions.
    void set_change(Newton<T> &newton, const System<T> &system, const VectorXd &r) {
        const VectorXd next = newton.next(r),
                       change = system.right.cwiseProduct(next - newton.mapped());
        best_.change = scaling_.contact_part(change).norm() / best_.acting;
    }

    const Operator &op_;
    const Options &options_;
    Budget budget_;
    Poll poll_;
    Judge<P> judge_;
    Scaling<T, P> scaling_;
    Solution best_;
    double last_error_ = 0.0; // of the state certified last
};

/// A problem of which neither W nor q is near the largest or smallest number there is. Squares of
/// such would not be numbers.
class Units {
  public:
    Units(const Operator &op, const VectorXd &q)
        : length_(Power::to_one(q)), force_(length_ - op.exponent()), stiffness_(-op.exponent()) {}

    VectorXd q(const VectorXd &given) const { return Power(length_)(given); }
    std::vector<VectorXd> starts(std::vector<VectorXd> given) const {
        for (VectorXd &start : given)
            start = Power(force_)(start).eval();
        return given;
    }
    Options options(Options given) const {
        Scales &scales = given.scales;
        for (VectorXd *stiffness : {&scales.stiffness, &scales.tangential, &scales.tied})
            *stiffness = Power(stiffness_)(*stiffness).eval();
        scales.external = Power(force_)(scales.external);
        return given;
    }
    /// In the units of who asked.
    Solution back(Solution found) const {
        const bool pressed = !found.reaction.isZero(0.0);
        found.reaction = Power(-force_)(found.reaction).eval();
        found.displacement = Power(-length_)(found.displacement).eval();
        found.acting = Power(-force_)(found.acting);
        const double largest = found.reaction.size() > 0 ? found.reaction.cwiseAbs().maxCoeff() : 0;
        if (found.converged && pressed && !std::isnormal(largest))
            throw std::range_error("the reactions are too large or too small for double precision: "
                                   "choose other units of length or force");
        return found;
    }

  private:
    int length_, force_, stiffness_; // exponents of two
};

template <int T>
Solution solve(const Operator &op, const AnyLaw<T> &law, const VectorXd &q,
               const std::vector<VectorXd> &starts, const Options &options) {
    const Units units(op, q);
    const VectorXd scaled = units.q(q);
    const Options inside = units.options(options);
    if (T == 0 || Coefficients<T>(law, op.nodes()).frictionless())
        return units.back(Search<0, T>(op, law, scaled, inside).run(units.starts(starts)));
    return units.back(Search<T, T>(op, law, scaled, inside).run(units.starts(starts)));
}
} // namespace dolfinx_contact::condensed
