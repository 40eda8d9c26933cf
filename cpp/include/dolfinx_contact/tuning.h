// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file tuning.h
/// Every number of the condensed solver that somebody may want to change, but for limits that a
/// caller chooses (Options). Those of methods and linear algebra do not change which states are
/// solutions; `negligible` and those of the judge enter the errors. Scaled reactions and
/// displacements are about one in size.
#pragma once

#include <Eigen/Core>

namespace dolfinx_contact::condensed {
struct Tuning {
    using Index = Eigen::Index;

    // -- the methods in order: iterations at most ------------------------------------------------
    static constexpr int newton_most = 60;       ///< where it converges, 5 to 20 are enough
    static constexpr int interior_most = 120;    ///< its own, then Newton's
    static constexpr int proximal_most = 800;    ///< Newton's, of all subproblems
    static constexpr int homotopy_most = 20'000; ///< Newton's, of all paths

    // -- Newton's method -------------------------------------------------------------------------
    static constexpr double rho_n = 10.0;  ///< over the contact's normal compliance
    static constexpr double rho_t = 1.0;   ///< over its tangential one; both measured on punches
    static constexpr double stiffer = 3.0; ///< of the second attempt: factor of rho_t
    static constexpr int newton_patience = 12;      ///< iterations without progress: a circle
    static constexpr std::size_t newton_memory = 8; ///< merits of the nonmonotone line search
    static constexpr double decrease = 1e-4;        ///< of the merit, over its slope (Armijo)
    static constexpr double shortest_step = 1e-5;   ///< of the line search
    static constexpr double kept_factors = 1e-2; ///< old ones, where they leave that of the merit
    static constexpr double judged_from = 1e3;   ///< residual over the tolerance: the judge decides
    static constexpr double regularisation = 1e-9; ///< shift of a singular W, over the compliance

    // -- interior point --------------------------------------------------------------------------
    static constexpr int interior_iterations = 50;
    static constexpr double interior_accuracy = 1e-11; ///< of equations and gap: Newton's finishes
    static constexpr double interior_shortest = 1e-4;  ///< step: it has come to its end
    static constexpr double inside = 0.99;             ///< part of the way to the cone's boundary
    static constexpr double centring = 3.0;        ///< power of the gap's decrease in the predictor
    static constexpr double least_centring = 1e-8; ///< of the gap

    // -- proximal point: alpha over the compliance of a contact ----------------------------------
    static constexpr double first_alpha = 0.1, smallest_alpha = 1e-10, largest_alpha = 1e3;
    static constexpr double alpha_down = 0.2;        ///< after success; less of it after failures
    static constexpr double alpha_up = 5.0;          ///< after failure
    static constexpr double proximal_target = 1e-9;  ///< residual of a subproblem
    static constexpr int proximal_newton = 30;       ///< iterations of a subproblem
    static constexpr int proximal_patience = 40;     ///< subproblems that do not ...
    static constexpr double proximal_progress = 0.5; ///< ... bring the error below that of the best

    // -- homotopy: s from 0, an easier problem, to 1; random starts ------------------------------
    static constexpr int fewest_paths = 5, most_paths = 200;
    static constexpr double path_work = 5e5; ///< paths times unknowns squared
    static constexpr double first_part = 0.25, shortest_part = 1e-3, longest_part = 0.5; ///< of s
    static constexpr double path_target = 1e-6;  ///< residual on the way
    static constexpr double without_shift = 0.2; ///< part of the paths whose W is not shifted
    static constexpr double least_shift = -1.0, largest_shift = 1.5; ///< ten to this, over `own`
    static constexpr double mean_friction = 0.7; ///< part of the paths that begin with one mu
    static constexpr double least_start = -1.0, largest_start = 1.0; ///< ten to this, reactions
    static constexpr double open_at_first = 0.3;     ///< part of the contacts of a start
    static constexpr double friction_at_first = 0.7; ///< of r_n, both components: inside the cone

    // -- scales ----------------------------------------------------------------------------------
    static constexpr double negligible = 1e-14; ///< compliance, over the mean one: counts as none
    static constexpr double unlike = 1e2; ///< largest over least compliance: each its own units

    // -- judge -----------------------------------------------------------------------------------
    static constexpr double near_rounding = 1e-2; ///< of the tolerance: sums in twice the precision
    static constexpr double local_rounding = 32;  ///< eps of its terms: no defect of a contact
    static constexpr double unbounded = 67'108'864; ///< reactions over the forces that act, which
                                                    ///< then have half their digits: no solution

    // -- linear algebra --------------------------------------------------------------------------
    static constexpr double smallest_rcond = 1e-12;      ///< of a W that is inverted
    static constexpr double smallest_pivot = 1e-14;      ///< over the largest one: else singular
    static constexpr double smallest_of_rank = 1e-12;    ///< pivot of an orthogonal decomposition
    static constexpr Index worth_single_precision = 128; ///< unknowns: below, double costs nothing
    static constexpr double refined = 1e-12;             ///< residual of iterative refinement
    static constexpr double refined_enough = 1e-10;      ///< where it stops above that
    static constexpr double refinement = 0.1;            ///< contraction of the residual
    static constexpr Index few_columns = 16;             ///< factorised one by one
    static constexpr Index few_rows_to_invert = 64;      ///< smaller halves save nothing
    static constexpr Index operations_between_polls = 500'000'000; ///< some 0.1 s
    static constexpr int signals_every = 50; ///< milliseconds: Ctrl-C is heard
    static constexpr Index tile = 64;        ///< rows and columns: two of 32 kB are in cache
};
} // namespace dolfinx_contact::condensed
