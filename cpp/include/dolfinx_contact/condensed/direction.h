// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file direction.h
/// Newton's direction: the nodes' linearised problems put together and solved.
#pragma once

#include "node_step.h"

namespace dolfinx_contact::condensed {
template <int T> class Direction {
  public:
    static constexpr int D = T + 1;
    using Node = Eigen::Matrix<double, D, 1>;

    explicit Direction(const System<T> &system)
        : system_(system), linear_(system.W->algebra().solver(*system.poll)) {}

    /// Which factors: of the present Jacobian; of the last one, if its nodes had the same states
    /// and elimination; the same for a step that is not taken, which leaves out dw.
    enum class Factors { present, last, last_for_change };

    /// Newton's step by the smaller of the two eliminations, if there is a choice. Whether it was
    /// with the last factors.
    bool find(const State<T> &state, const VectorXd &r, const VectorXd &w, VectorXd &dr,
              VectorXd &dw, Factors factors = Factors::present) {
        Index compliance = system_.tied, stiffness = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state.points[static_cast<std::size_t>(i)];
            const bool open = point.branch == Branch::open, stick = point.branch == Branch::stick;
            compliance += open ? 0 : (stick ? D : std::max(T, 1));
            stiffness += open ? D : (stick ? 0 : T);
        }
        const bool stiff = system_.inverse && system_.shift == 0.0 && stiffness < compliance;
        std::vector<Branch> branches;
        steps_.clear();
        offsets_.clear();
        Index unknowns = 0;
        for (Index i = 0; i < system_.nodes; ++i) {
            const auto &point = state.points[static_cast<std::size_t>(i)];
            steps_.push_back(stiff ? by_stiffness<T>(system_, i, point, at(r, i), at(w, i))
                                   : by_compliance<T>(system_, i, point, at(r, i), at(w, i)));
            offsets_.push_back(unknowns);
            unknowns += steps_.back().m;
            branches.push_back(point.branch);
        }
        same_factors_ = factors != Factors::present && stiff == stiff_ && branches == branches_;
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
            if (factors != Factors::last_for_change)
                dw = system_.change(dr);
        }
        return same_factors_;
    }
    /// Whether another step with the last factors costs far less than one with factors of its own.
    bool worth_keeping() const { return linear_->of_many(); }

  private:
    static Node at(const VectorXd &v, Index i) { return v.template segment<D>(D * i); }

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
        VectorXd known = left.cwiseProduct(matrix * VectorXd(right.cwiseProduct(found)));
        if (system_.shift > 0.0) // never by stiffness
            known += left.cwiseProduct(system_.shifted(right.cwiseProduct(found)));
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
        const VectorXd y =
            same_factors_ ? linear_->again(rhs) : factored(matrix, left, right, unknowns, rhs);
        for (const Index i : active_) {
            const auto &step = steps_[static_cast<std::size_t>(i)];
            found.template segment<D>(D * i) +=
                step.B.leftCols(step.m) * y.segment(offset(i), step.m);
        }
        found.tail(tied_) += y.tail(tied_);
        return found;
    }

    /// J^-1 rhs. Where J is singular, with more contacts than the body has degrees of freedom: of
    /// few unknowns the shortest of the steps that fit best, of many the step of W + shift, which
    /// costs no more than a regular one.
    VectorXd factored(const Square &matrix, const VectorXd &left, const VectorXd &right,
                      Index unknowns, const VectorXd &rhs) {
        for (VectorXd y;; singular_ = true) { // a second time at most
            assemble(matrix, unknowns, system_.shift + (singular_ ? Tuning::regularisation : 0.0));
            tie(matrix, left, right);
            if (linear_->solve(J_, rhs, y, singular_) || singular_)
                return y;
        }
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

    /// J = to (matrix + shift) from + G, node by node, from the entries of the matrix that are
    /// stored.
    void assemble(const Square &matrix, Index unknowns, double shift) {
        J_.resize(unknowns, unknowns);
        const auto count = static_cast<Index>(active_.size());
        for (Index b = 0; b < count; ++b) {
            const auto [first, last] = matrix.stored(b, count);
            for (Index a = first; a < last; ++a) {
                Eigen::Matrix<double, D, D> block =
                    matrix.template block<D>(in(active_, a), in(active_, b));
                if (a == b)
                    block.diagonal().array() += shift * system_.own[in(active_, a)];
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

    const System<T> &system_;
    std::vector<NodeStep<T>> steps_;
    std::vector<Index> offsets_, active_;
    std::vector<Eigen::Matrix<double, D, D>> to_, from_;
    MatrixXd J_;
    std::unique_ptr<LinearSolver> linear_;
    std::vector<Branch> branches_; // with which J was made
    bool stiff_ = false, same_factors_ = false, singular_ = false;
    Index tied_ = 0; // tied rows that J has
};
} // namespace dolfinx_contact::condensed
