// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_cascade.h
/// solve_condensed: the contact problem w = q + W r on plain arrays, by Newton's method and, where
/// that fails, a cascade of fallbacks.
#pragma once

#include "condensed_attempts.h"
#include <stdexcept>

namespace dolfinx_contact::condensed {
/// The solver of one problem: P tangential directions, T of them with friction (T = P or 0).
template <int T, int P> class Cascade : private Attempts<T, P> {
  public:
    using Attempts<T, P>::Attempts;

    Solution run(const std::vector<VectorXd> &starts) {
        best_.reaction = VectorXd::Zero(q_.size());
        best_.tied = op_.tied();
        judge_.judge(best_);
        if (Judge<P>::reached(best_.error, 0.0,
                              best_.rounding)) { // nothing presses: zero reactions are the answer
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
    using Base = Attempts<T, P>;
    using Base::attempt, Base::best_, Base::budget_, Base::judge_, Base::op_, Base::options_,
        Base::q_, Base::scaling_;

    void search(const std::vector<VectorXd> &starts) {
        const VectorXd given = scaling_.make_unit(nearest(starts));
        const VectorXd zero = VectorXd::Zero(scaling_.size());
        if (op_.nodes() == 1 && op_.tied() == 0 &&
            attempt("one contact", [this] { this->one_contact(); }))
            return;
        const bool sparse = op_.pattern() != nullptr;
        VectorXd end; // of the interior point method
        const auto interior = [&] {
            return end.size() == 0 && InteriorPoint<T>::applies(scaling_.make()) &&
                   attempt("interior point", [&] { end = this->interior(); });
        };
        // of many contacts without a start few are solved by Newton's method alone
        if (sparse && options_.fallbacks && given.isZero(0.0) &&
            (attempt("splitting", [this] { this->near(); }) || interior()))
            return;
        if (attempt("newton", [&] { this->newton(given); }) || !options_.fallbacks)
            return;
        const System<T> system = scaling_.make();
        const bool smooth = InteriorPoint<T>::applies(system);
        // many contacts of rigid bodies need methods that others hardly do
        const bool rigid =
            sparse || (op_.nodes() >= Operator::many && op_.tied() == 0 &&
                       system.product != nullptr && system.product->get() != nullptr);
        if (!rigid && other_parameters(given))
            return;
        constexpr Index pivotable = 64;
        if (T == 1 && P == 1 && op_.tied() == 0 && op_.nodes() <= pivotable &&
            (attempt("pivots", [this] { this->in_the_plane(); }) || best_.unsolvable))
            return;
        if (interior() || attempt("feasibility", [this] { this->feasibility(); }) ||
            best_.unsolvable)
            return;
        const auto proximal = [&](int in_vain) {
            return smooth && attempt("proximal point", [&] { this->proximal_from(end, in_vain); });
        };
        std::optional<Wandering<T>> wandering;
        const auto by_turns = [&](int rounds) {
            if (!wandering)
                wandering.emplace(system);
            return attempt("sweeps and splitting", [&] { this->by_turns(*wandering, rounds); });
        };
        // first as long as these methods take where they are good
        if (rigid && (proximal(8) || other_parameters(given) || by_turns(5)))
            return;
        if (proximal(Base::patience))
            return;
        const auto path = [&] {
            return T > 0 && smooth && attempt("path", [this] { this->path(); });
        };
        if (sparse && (path() || by_turns(150)))
            return;
        std::minstd_rand random(1);
        const auto paths = [&](int count) {
            for (int k = 0; k < count && !best_.converged && !budget_.spent(); ++k)
                this->follow(random);
        };
        const auto few_paths = [&] {
            constexpr int few = 5;
            return attempt("continuation", [&] { paths(few); });
        };
        if (few_paths() || attempt("sweeps and proximal point", [&] { this->swept(given, 300); }) ||
            attempt("sweeps", [&] { this->swept(zero, 2000); }))
            return;
        if (sparse ? by_turns(150) : path())
            return;
        for (const Form form : {Form::metric_between, Form::units_of_contacts}) {
            if (sparse || !scaling_.far_apart())
                break;
            scaling_.take(form);
            end.resize(0);
            if (attempt("newton", [&] { this->newton(zero); }) || other_parameters(zero) ||
                interior() || proximal(Base::patience) || few_paths() || path())
                return;
        }
        const auto size = static_cast<double>(scaling_.size());
        attempt("continuation, many starts",
                [&] { paths(static_cast<int>(std::min(1000.0, 3e6 / (size * size)))); });
    }

    /// Newton's method with other augmentation parameters.
    bool other_parameters(const VectorXd &given) {
        if (T > 0)
            for (const double tangential : {3.0, 0.3})
                if (attempt("newton, other rho_t", [&] { this->newton(given, tangential); }))
                    return true;
        return false;
    }

    /// The start of the smallest residual, scaled; zero is always one.
    VectorXd nearest(const std::vector<VectorXd> &starts) const {
        System<T> system = scaling_.make();
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
        return units.back(Cascade<0, T>(op, law, scaled, inside).run(units.starts(starts)));
    return units.back(Cascade<T, T>(op, law, scaled, inside).run(units.starts(starts)));
}
} // namespace dolfinx_contact::condensed
