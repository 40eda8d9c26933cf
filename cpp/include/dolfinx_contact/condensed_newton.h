// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_newton.h
/// Globalised semismooth Newton method for the condensed contact problem.
#pragma once

#include "condensed_linear.h"
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
            VectorXd dr, dw;
            direction(r, w, dr, dw);
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

    /// After convergence at r: by how much the next step would move what the law returned there.
    /// With the factors of the last step where they still fit, which then costs no more than
    /// products with W.
    VectorXd next_change(const VectorXd &r) {
        VectorXd dr, dw;
        direction(r, system_.displacement(r), dr, dw, true);
        return r + dr - state_.mapped();
    }

  private:
    static Node at(const VectorXd &v, Index i) { return v.template segment<D>(D * i); }

    /// Newton's step by the smaller of the two eliminations, if there is a choice.
    void direction(const VectorXd &r, const VectorXd &w, VectorXd &dr, VectorXd &dw,
                   bool last = false) {
        Index compliance = system_.tied, stiffness = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state_.points[static_cast<std::size_t>(i)];
            const bool open = point.branch == Branch::open, stick = point.branch == Branch::stick;
            compliance += open ? 0 : (stick ? D : std::max(T, 1));
            stiffness += open ? D : (stick ? 0 : T);
        }
        const bool stiff = system_.inverse && stiffness < compliance;
        std::vector<Branch> branches;
        steps_.clear();
        offsets_.clear();
        Index unknowns = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state_.points[static_cast<std::size_t>(i)];
            steps_.push_back(stiff ? by_stiffness<T>(system_, i, point, at(r, i), at(w, i))
                                   : by_compliance<T>(system_, i, point, at(r, i), at(w, i)));
            offsets_.push_back(unknowns);
            unknowns += steps_.back().m;
            branches.push_back(point.branch);
        }
        same_factors_ = last && stiff == stiff_ && branches == branches_;
        stiff_ = stiff;
        branches_ = std::move(branches);
        const VectorXd left = -w.tail(system_.tied); // of tied rows
        if (stiff) {
            tied_ = 0; // their motion is known
            dw = eliminate(*system_.inverse, system_.right.cwiseInverse(),
                           system_.left.cwiseInverse(), unknowns, left);
            dr = system_.change_of_reaction(dw);
        } else {
            tied_ = system_.tied;
            dr = eliminate(*system_.W, system_.left, system_.right, unknowns + tied_, left);
            if (!last)
                dw = system_.change(dr);
        }
    }

    /// c + B y with y from L A (c + B y) + G y = g, A = diag(left) matrix diag(right). Of tied rows
    /// y is the unknown force and A (c + B y) = `in_tied_rows`; or that is known and no unknown.
    VectorXd eliminate(const Square &matrix, const VectorXd &left, const VectorXd &right,
                       Index unknowns, const VectorXd &in_tied_rows) {
        VectorXd found(system_.size());
        found.tail(system_.tied) = in_tied_rows;
        found.tail(tied_).setZero();
        active_.clear();
        for (Index i = 0; i < system_.nodes; ++i) {
            auto &step = steps_[static_cast<std::size_t>(i)];
            found.template segment<D>(D * i) = step.c;
            if (step.m > 0)
                active_.push_back(i);
        }
        if (unknowns == 0)
            return found;
        const VectorXd known = left.cwiseProduct(matrix * VectorXd(right.cwiseProduct(found)));
        VectorXd rhs(unknowns);
        to_.clear();
        from_.clear();
        for (const Index i : active_) {
            const auto &step = steps_[static_cast<std::size_t>(i)];
            rhs.segment(offset(i), step.m) = (step.g - step.L * at(known, i)).head(step.m);
            to_.emplace_back(step.L * at(left, i).asDiagonal());
            from_.emplace_back(at(right, i).asDiagonal() * step.B);
        }
        rhs.tail(tied_) = in_tied_rows.head(tied_) - known.tail(tied_);
        if (!same_factors_) {
            assemble(matrix, unknowns);
            tie(matrix, left, right);
        }
        const VectorXd y = same_factors_ ? linear_.again(rhs) : linear_.solve(J_, rhs);
        for (const Index i : active_) {
            const auto &step = steps_[static_cast<std::size_t>(i)];
            found.template segment<D>(D * i) +=
                step.B.leftCols(step.m) * y.segment(offset(i), step.m);
        }
        found.tail(tied_) += y.tail(tied_);
        return found;
    }

    /// Rows and columns of J of tied rows, which are the last ones.
    void tie(const Square &matrix, const VectorXd &left, const VectorXd &right) {
        const Index first = J_.rows() - tied_, row = D * system_.nodes;
        for (Index c = 0; c < tied_; ++c) {
            for (std::size_t a = 0; a < active_.size(); ++a) {
                const Index i = active_[a];
                Node across, down;
                for (int k = 0; k < D; ++k) {
                    across[k] = matrix(row + c, D * i + k);
                    down[k] = matrix(D * i + k, row + c);
                }
                const int m = in(steps_, i).m;
                J_.block(first + c, offset(i), 1, m) =
                    left[row + c] * (across.transpose() * from_[a]).leftCols(m);
                J_.block(offset(i), first + c, m, 1) = (to_[a] * down).head(m) * right[row + c];
            }
            for (Index d = 0; d < tied_; ++d)
                J_(first + c, first + d) =
                    left[row + c] * matrix(row + c, row + d) * right[row + d];
        }
    }

    /// J = to matrix from + G, node by node, from the entries of the matrix that are stored.
    void assemble(const Square &matrix, Index unknowns) {
        J_.resize(unknowns, unknowns);
        const auto count = static_cast<Index>(active_.size());
        for (Index b = 0; b < count; ++b) {
            const auto [first, last] = matrix.stored(b, count);
            for (Index a = first; a < last; ++a) {
                const auto block = matrix.template block<D>(in(active_, a), in(active_, b));
                couple(a, b, block);
                if (matrix.symmetric() && a != b)
                    couple(b, a, block.transpose());
            }
            const Index j = in(active_, b);
            const auto &step = in(steps_, j);
            J_.block(offset(j), offset(j), step.m, step.m) += step.G.topLeftCorner(step.m, step.m);
        }
    }
    template <class Block> void couple(Index a, Index b, const Block &block) {
        const Index i = in(active_, a), j = in(active_, b);
        const int rows = in(steps_, i).m, columns = in(steps_, j).m;
        if constexpr (D == 3)
            if (rows == 2 && columns == 2) { // slipping nodes: the most of them
                J_.template block<2, 2>(offset(i), offset(j)) =
                    (in(to_, a).template topRows<2>() * block) *
                    in(from_, b).template leftCols<2>();
                return;
            }
        const Eigen::Matrix<double, D, D> entries = in(to_, a) * block * in(from_, b);
        for (int k = 0; k < columns; ++k)
            for (int l = 0; l < rows; ++l)
                J_(offset(i) + l, offset(j) + k) = entries(l, k);
    }
    Index offset(Index i) const { return in(offsets_, i); }
    template <class Vector> static const auto &in(const Vector &vector, Index i) {
        return vector[static_cast<std::size_t>(i)];
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
                w = w_trial;
                std::swap(state_, trial);
                return true;
            }
        }
        return false;
    }

    const System<T> &system_;
    State<T> state_;
    std::vector<NodeStep<T>> steps_;
    std::vector<Index> offsets_, active_;
    std::vector<Eigen::Matrix<double, D, D>> to_, from_;
    MatrixXd J_;
    LinearSolver linear_;
    std::vector<Branch> branches_; // with which J was made
    bool stiff_ = false, same_factors_ = false;
    Index tied_ = 0; // tied rows that J has
};
} // namespace dolfinx_contact::condensed
