// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_newton.h
/// Globalised semismooth Newton method for the condensed contact problem.
#pragma once

#include "condensed_step.h"
#include <chrono>
#include <deque>

namespace dolfinx_contact::condensed {
/// Why an attempt ended.
enum class End { converged, line_search, stalled, iterations, seconds, not_finite };

/// Iterations and seconds that all attempts share.
struct Budget {
    using Clock = std::chrono::steady_clock;
    Clock::time_point start = Clock::now();
    double max_seconds;
    int iterations = 0, max_iterations;

    double seconds() const { return std::chrono::duration<double>(Clock::now() - start).count(); }
    bool spent() const { return iterations >= max_iterations || seconds() >= max_seconds; }
};

/// Solves J y = rhs with factors in single precision and iterative refinement; false if that does
/// not converge, because J is too badly conditioned for it.
inline bool solve_in_single(const MatrixXd &J, const VectorXd &rhs, VectorXd &y) {
    constexpr double accuracy = 1e-12, contraction = 0.1;
    const double scale = rhs.lpNorm<Eigen::Infinity>();
    Eigen::MatrixXf single = J.cast<float>();
    const Eigen::PartialPivLU<Eigen::Ref<Eigen::MatrixXf>> lu(single);
    y.setZero(rhs.size());
    VectorXd rest = rhs;
    for (double size = scale; size > accuracy * scale;) {
        const Eigen::VectorXf unit = (rest / size).cast<float>();
        y += size * lu.solve(unit).cast<double>();
        rest = rhs - J * y;
        const double after = rest.lpNorm<Eigen::Infinity>();
        if (!(after <= contraction * size))
            return after <= 1e2 * accuracy * scale;
        size = after;
    }
    return true;
}

/// Solves J y = rhs. J is singular where W is, with more contacts than the body has degrees of
/// freedom; the shortest of the steps that fit best is taken then.
inline VectorXd solve_any_rank(const MatrixXd &J, const VectorXd &rhs) {
    constexpr double smallest_rcond = 1e-14, threshold = 1e-12;
    constexpr Index worth_it = 128; // below, double precision costs nothing
    VectorXd y;
    if (J.rows() >= worth_it && solve_in_single(J, rhs, y))
        return y;
    {
        const Eigen::PartialPivLU<MatrixXd> lu(J);
        if (lu.rcond() > smallest_rcond)
            return lu.solve(rhs);
    }
    Eigen::CompleteOrthogonalDecomposition<MatrixXd> decomposition(J.rows(), J.cols());
    decomposition.setThreshold(threshold);
    return decomposition.compute(J).solve(rhs);
}

/// Newton's method on the residual of a System with a nonmonotone line search
/// [L. Grippo, F. Lampariello, S. Lucidi, SIAM J. Numer. Anal. 23 (1986)].
template <int T> class Newton {
  public:
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;

    explicit Newton(const System<T> &system) : system_(system) {}

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
            const double size = std::max(1.0, r.template lpNorm<Eigen::Infinity>());
            if (std::sqrt(2.0 * state_.merit) <= target * size && certified(state_.mapped()))
                return End::converged;
            if (iteration == max_iterations || budget.spent()) {
                r = best;
                return iteration == max_iterations || budget.seconds() < budget.max_seconds
                           ? End::iterations
                           : End::seconds;
            }
            if (in_vain > patience) {
                r = best;
                return End::stalled;
            }
            ++budget.iterations;
            const VectorXd dr = direction(r, w);
            const VectorXd dw = system_.change(dr);
            if (!line_search(r, w, dr, dw, *std::max_element(memory.begin(), memory.end()))) {
                r = best;
                return End::line_search;
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

  private:
    static Node at(const VectorXd &v, Index i) { return v.template segment<D>(D * i); }

    /// The smaller of the two eliminations, if there is a choice.
    VectorXd direction(const VectorXd &r, const VectorXd &w) {
        Index compliance = 0, stiffness = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state_.points[static_cast<std::size_t>(i)];
            const bool open = point.branch == Branch::open, stick = point.branch == Branch::stick;
            compliance += open ? 0 : (stick ? D : std::max(T, 1));
            stiffness += open ? D : (stick ? 0 : T);
        }
        const bool stiff = system_.inverse && stiffness < compliance;
        steps_.clear();
        offsets_.clear();
        Index unknowns = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state_.points[static_cast<std::size_t>(i)];
            steps_.push_back(stiff ? by_stiffness<T>(system_, i, point, at(r, i), at(w, i))
                                   : by_compliance<T>(system_, i, point, at(r, i), at(w, i)));
            offsets_.push_back(unknowns);
            unknowns += steps_.back().m;
        }
        const VectorXd found = stiff ? eliminate(*system_.inverse, system_.right.cwiseInverse(),
                                                 system_.left.cwiseInverse(), unknowns)
                                     : eliminate(*system_.W, system_.left, system_.right, unknowns);
        return stiff ? system_.change_of_reaction(found) : found;
    }

    /// c + B y with y from L A (c + B y) + G y = g, A = diag(left) matrix diag(right).
    VectorXd eliminate(const MatrixXd &matrix, const VectorXd &left, const VectorXd &right,
                       Index unknowns) {
        VectorXd found(system_.size());
        for (Index i = 0; i < system_.nodes; ++i)
            found.template segment<D>(D * i) = steps_[static_cast<std::size_t>(i)].c;
        if (unknowns == 0)
            return found;
        const VectorXd known = left.cwiseProduct(matrix * right.cwiseProduct(found));
        MatrixXd J(unknowns, unknowns);
        VectorXd rhs(unknowns), column(system_.size());
        for (Index j = 0; j < system_.nodes; ++j) {
            const auto &from = steps_[static_cast<std::size_t>(j)];
            const Index J0 = offsets_[static_cast<std::size_t>(j)];
            for (int k = 0; k < from.m; ++k) {
                const Node weights = at(right, j).cwiseProduct(from.B.col(k));
                column.noalias() = matrix.template middleCols<D>(D * j) * weights;
                column.array() *= left.array();
                for (Index i = 0; i < system_.nodes; ++i) {
                    const auto &to = steps_[static_cast<std::size_t>(i)];
                    const Index I0 = offsets_[static_cast<std::size_t>(i)];
                    const double *v = column.data() + D * i;
                    for (int l = 0; l < to.m; ++l) {
                        double sum = 0.0;
                        for (int c = 0; c < D; ++c)
                            sum += to.L(l, c) * v[c];
                        J(I0 + l, J0 + k) = sum;
                    }
                }
                for (int l = 0; l < from.m; ++l)
                    J(J0 + l, J0 + k) += from.G(l, k);
            }
            rhs.segment(J0, from.m) = (from.g - from.L * at(known, j)).head(from.m);
        }
        const VectorXd y = solve_any_rank(J, rhs);
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &step = steps_[static_cast<std::size_t>(i)];
            found.template segment<D>(D * i) +=
                step.B.leftCols(step.m) * y.segment(offsets_[static_cast<std::size_t>(i)], step.m);
        }
        return found;
    }

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
                w = system_.displacement(r);
                state_.evaluate(system_, r, w);
                return true;
            }
        }
        return false;
    }

    const System<T> &system_;
    State<T> state_;
    std::vector<NodeStep<T>> steps_;
    std::vector<Index> offsets_;
};
} // namespace dolfinx_contact::condensed
