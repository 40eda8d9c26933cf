// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file homotopy.h
/// Homotopy: a path of solutions from an easier problem [E. L. Allgower, K. Georg, Numerical
/// Continuation Methods, Springer (1990)].
#pragma once

#include "newton.h"
#include "scaling.h"
#include <random>
#include <utility>

namespace dolfinx_contact::condensed {
/// Random numbers that are the same in every run and on every machine.
class Random {
  public:
    double uniform(double low = 0.0, double high = 1.0) {
        return low + (high - low) * static_cast<double>(engine_() - std::minstd_rand::min()) /
                         static_cast<double>(std::minstd_rand::max() - std::minstd_rand::min());
    }
    double power_of_ten(double low, double high) { return std::pow(10.0, uniform(low, high)); }

    /// Scaled reactions in the cone, of any size about one; those of tied rows are zero.
    template <int T> VectorXd reactions(Index nodes, Index tied) {
        constexpr int D = T + 1;
        VectorXd r = VectorXd::Zero(D * nodes + tied);
        const double size = power_of_ten(Tuning::least_start, Tuning::largest_start);
        for (Index i = 0; i < nodes; ++i) {
            const double normal = uniform() < Tuning::open_at_first ? 0.0 : size * uniform();
            r[D * i + T] = normal;
            for (int c = 0; c < T; ++c)
                r[D * i + c] =
                    normal * uniform(-Tuning::friction_at_first, Tuning::friction_at_first);
        }
        return r;
    }

  private:
    std::minstd_rand engine_{1};
};

/// A problem for each s from zero to one. At zero contacts give way more, by `shift` times their
/// compliance, the slip rule is associated and, or not, friction is that of the mean coefficient.
template <int T, int P> class Homotopy {
  public:
    Homotopy(const Scaling<T, P> &scaling, Budget &budget, Random &random)
        : scaling_(scaling), budget_(budget),
          shift_(random.uniform() < Tuning::without_shift
                     ? 0.0
                     : random.power_of_ten(Tuning::least_shift, Tuning::largest_shift)),
          friction_(random.uniform() < Tuning::mean_friction),
          r_(random.template reactions<T>(scaling.nodes(), scaling.tied())) {}

    /// Follows solutions from s = 0; at s = 1 finish(r) solves the problem itself. Steps are halved
    /// where Newton's method fails and doubled where it does not.
    template <class Finish> void run(const Finish &finish) {
        VectorXd before;
        double reached = 0.0, reached_before = 0.0, step = Tuning::first_part;
        if (!solved(0.0, r_, finish))
            return;
        while (reached < 1.0 && step >= Tuning::shortest_part && !budget_.spent()) {
            const double s = std::min(1.0, reached + step);
            VectorXd trial = r_;
            if (before.size() > 0)
                trial += (s - reached) / (reached - reached_before) * (r_ - before);
            bool found = solved(s, trial, finish);
            if (!found && before.size() > 0) {
                trial = r_;
                found = solved(s, trial, finish);
            }
            if (found) {
                before = std::exchange(r_, trial);
                reached_before = std::exchange(reached, s);
                step = std::min(Tuning::longest_part, 2.0 * step);
            } else {
                step *= 0.5;
            }
        }
    }

  private:
    template <class Finish> bool solved(double s, VectorXd &r, const Finish &finish) {
        if (s == 1.0)
            return finish(r);
        System<T> system = scaling_.make(friction_ ? s : 1.0, s);
        system.shift = (1.0 - s) * shift_;
        return Newton<T>(system).solve(r, Tuning::path_target, budget_, Tuning::newton_most,
                                       [](const VectorXd &) { return true; });
    }

    const Scaling<T, P> &scaling_;
    Budget &budget_;
    double shift_;
    bool friction_;
    VectorXd r_;
};
} // namespace dolfinx_contact::condensed
