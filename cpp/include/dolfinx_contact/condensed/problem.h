// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file problem.h
/// What goes into the solution of a condensed problem, and what comes out. The definition of
/// `solve`, whose compilation takes a minute, is in search.h.
#pragma once

#include "../law/law.h"
#include "operator.h"
#include <array>
#include <functional>
#include <string>
#include <vector>

namespace dolfinx_contact::condensed {
/// One method that was tried.
struct Attempt {
    std::string branch;
    bool converged;
    int iterations;
    double seconds, error, slip_error; ///< the errors of the best state so far
};

/// Reactions and displacements, (T + 1) per node, then those of tied rows, in the units of q and W.
struct Solution {
    static constexpr double none = std::numeric_limits<double>::infinity();
    VectorXd reaction, displacement;
    std::vector<Branch> status;
    double error = none, slip_error = none;
    double local_error = none; ///< the largest of a contact, over the force that acts in it
    double rounding = none, slip_rounding = none; ///< what double precision leaves of the errors
    double change = none; ///< of the reactions in Newton's next step, over `acting`
    double acting = 0.0;  ///< the force that errors are relative to
    bool near_rounding = false;
    Index tied = 0; ///< how many of the reactions
    int iterations = 0;
    double seconds = 0.0;
    bool converged = false;
    std::string branch; ///< the method that found it, "free" if none was needed, "" if none did
    std::vector<Attempt> tried;
};

/// Scales of the errors that a caller may give; W gives those that are empty.
struct Scales {
    VectorXd stiffness;  ///< kappa of each contact, (n,), force per length; else 1 / W_nn
    VectorXd tangential; ///< symmetric (T, T) of each contact, (n T T,); else 1 / W along a defect
    VectorXd tied;       ///< of each tied row; else 1 / its largest entry
    double external = 0.0; ///< a force that acts beside the reactions
};

/// What a caller may choose.
struct Options {
    double tol = 1e-8;      ///< largest error of a solution
    double slip_tol = 1e-8; ///< largest slip error of a solution
    double local_tol = std::numeric_limits<double>::infinity(); ///< largest error of one contact
    double max_seconds = std::numeric_limits<double>::infinity();
    int max_iterations = 200'000;                ///< of all methods together
    int newton_iterations = Tuning::newton_most; ///< of one run of Newton's method on the problem
    bool fallbacks = true;
    std::vector<std::string> without = {}; ///< methods that are left out, to measure what they do
    Scales scales = {};
    /// Called in every iteration of every method; what it throws ends the search.
    std::function<void()> heed = {};
    /// Told every iterate: its residual, dimensionless, and contacts open, sticking and slipping.
    std::function<void(double, const std::array<int, 3> &)> monitor = {};
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
/// - local_error: the largest of both of one contact, over max(|r|, kappa |w|) of that contact,
/// where
///   it is above eps times the size of the terms that cancel;
/// - rounding: eps times the size of the terms that cancel in them, over S.
///
/// T = 0 is contact without friction on normal components alone.
/// @param starts reactions to start from; the one of the smallest residual is taken
template <int T>
Solution solve(const Operator &op, const AnyLaw<T> &law, const VectorXd &q,
               const std::vector<VectorXd> &starts, const Options &options);
} // namespace dolfinx_contact::condensed
