// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_blocks.h
/// The scaled W with a block of each contact: the matrix of methods in which no contact is rigid or
/// open.
#pragma once

#include "condensed_system.h"

namespace dolfinx_contact::condensed {
/// Factors of (W + shift) B + A, where A and B have a block for each contact: of few entries, or of
/// few unknowns where the rank of W is low, or dense ones.
template <int T> class BlockSolver {
  public:
    static constexpr int D = T + 1;
    using Block = Eigen::Matrix<double, D, D>;
    using Blocks = std::vector<Block>; // of the contacts

    explicit BlockSolver(const System<T> &system)
        : system_(system), linear_(system.W->algebra().solver()),
          sparse_(system.pattern != nullptr) {}

    /// False if the matrix is singular. Without B it is I.
    bool factor(const Blocks &A, const Blocks *B = nullptr) {
        constexpr double filled = 0.6; // entries of factors over those of dense ones
        B_.clear();
        if (B != nullptr)
            B_ = *B;
        A_ = A;
        if (system_.shift > 0.0)
            add_shift();
        if (sparse_) {
            const bool regular = factor_sparse();
            sparse_ = !(linear_->fill() > filled);
            by_rank_ = false;
            return regular;
        }
        by_rank_ = product() != nullptr;
        if (by_rank_)
            factor_by_rank();
        else
            factor_dense();
        return true;
    }

    /// With the last factors. Those by rank lose digits; where refinement does not give back as
    /// many as a step needs, others are made.
    VectorXd solve(const VectorXd &rhs) {
        constexpr double accuracy = 1e-10, needed = 1e-6;
        constexpr int refinements = 3;
        if (by_rank_) {
            VectorXd x = solve_by_rank(rhs), rest = rhs - times(x);
            for (int k = 0; k < refinements && !(rest.norm() <= accuracy * rhs.norm()); ++k) {
                x += solve_by_rank(rest);
                rest = rhs - times(x);
            }
            if (rest.norm() <= needed * rhs.norm())
                return x;
            by_rank_ = false;
            if (system_.pattern == nullptr || !factor_sparse())
                factor_dense();
        }
        return linear_->again(rhs);
    }

    /// The entries of the last factors over those of dense ones; of sparse W.
    double fill() const { return linear_->fill(); }

  private:
    const Product *product() const {
        return system_.product == nullptr ? nullptr : system_.product->get();
    }
    static auto of(Index i) { return static_cast<std::size_t>(i); }
    /// A block for each contact times a vector; no blocks are I.
    static VectorXd times(const Blocks &blocks, VectorXd x) {
        for (std::size_t i = 0; i < blocks.size(); ++i) {
            auto part = x.template segment<D>(D * static_cast<Index>(i));
            part = (blocks[i] * part).eval();
        }
        return x;
    }
    VectorXd times(const VectorXd &x) const {
        const VectorXd forces = system_.right.cwiseProduct(times(B_, x));
        return system_.left.cwiseProduct(*system_.W * forces) + times(A_, x);
    }

    /// What is added to the diagonal of W, to A.
    void add_shift() {
        for (Index i = 0; i < system_.nodes; ++i) {
            const Eigen::Matrix<double, D, 1> shift =
                system_.shift * system_.left.template segment<D>(D * i).cwiseProduct(
                                    system_.right.template segment<D>(D * i));
            if (B_.empty())
                A_[of(i)] += shift.asDiagonal();
            else
                A_[of(i)] += shift.asDiagonal() * B_[of(i)];
        }
    }

    void factor_dense() {
        MatrixXd J = system_.left.asDiagonal() * system_.W->dense() * system_.right.asDiagonal();
        for (Index j = 0; j < system_.nodes; ++j) {
            if (!B_.empty())
                J.middleCols<D>(D * j) = (J.middleCols<D>(D * j) * B_[of(j)]).eval();
            J.block<D, D>(D * j, D * j) += A_[of(j)];
        }
        linear_->factor(J);
    }

    bool factor_sparse() {
        Eigen::SparseMatrix<double> J(system_.size(), system_.size());
        J.reserve(D * D * system_.pattern->blocks());
        Blocks column;
        for (Index j = 0; j < system_.nodes; ++j) {
            const std::vector<Index> &contacts = system_.pattern->moved_by(j);
            column.clear();
            for (std::size_t a = 0; a < contacts.size(); ++a)
                column.push_back(block(contacts[a], j, static_cast<Index>(a)));
            for (int k = 0; k < D; ++k) {
                J.startVec(D * j + k);
                for (std::size_t a = 0; a < contacts.size(); ++a)
                    for (int l = 0; l < D; ++l)
                        J.insertBack(D * contacts[a] + l, D * j + k) = column[a](l, k);
            }
        }
        J.finalize();
        return linear_->factor(J);
    }
    /// Of the matrix, at contact j and its a-th one, i.
    Block block(Index i, Index j, Index a) const {
        Block found = system_.left.template segment<D>(D * i).asDiagonal() *
                      system_.pattern->template block<D>(j, a) *
                      system_.right.template segment<D>(D * j).asDiagonal();
        if (!B_.empty())
            found *= B_[of(j)];
        if (i == j)
            found += A_[of(j)];
        return found;
    }

    /// (C X B + A)^-1 = A^-1 - A^-1 C (I + X B A^-1 C)^-1 X B A^-1, M. A. Woodbury's formula.
    void factor_by_rank() {
        inverse_.resize(A_.size());
        for (std::size_t i = 0; i < A_.size(); ++i)
            inverse_[i] = A_[i].inverse();
        const Product &W = *product();
        const Index r = W.X.rows();
        MatrixXd S = MatrixXd::Identity(r, r);
        VectorXd column(system_.size());
        std::vector<Index> touched; // contacts of the column
        for (Index k = 0; k < r; ++k) {
            touched.clear();
            for (Eigen::SparseMatrix<double>::InnerIterator it(W.C, k); it; ++it) {
                const Index i = it.row() / D;
                if (touched.empty() || touched.back() != i) {
                    touched.push_back(i);
                    column.template segment<D>(D * i).setZero();
                }
                column[it.row()] = system_.left[it.row()] * it.value();
            }
            for (const Index i : touched) {
                Eigen::Matrix<double, D, 1> v = inverse_[of(i)] * column.template segment<D>(D * i);
                if (!B_.empty())
                    v = (B_[of(i)] * v).eval();
                v = v.cwiseProduct(system_.right.template segment<D>(D * i));
                S.col(k) += W.X.template middleCols<D>(D * i) * v;
            }
        }
        linear_->factor(S);
    }
    VectorXd solve_by_rank(const VectorXd &rhs) const {
        const Product &W = *product();
        const VectorXd y = times(inverse_, rhs);
        const VectorXd forces = system_.right.cwiseProduct(times(B_, y));
        VectorXd motion(W.X.rows());
        system_.W->algebra().multiply(view(W.X), view(forces), result(motion));
        const VectorXd t = linear_->again(motion);
        return y - times(inverse_, system_.left.cwiseProduct(W.C * t));
    }

    const System<T> &system_;
    std::unique_ptr<LinearSolver> linear_; // of few unknowns, by rank
    Blocks A_, B_, inverse_;
    bool sparse_, by_rank_ = false;
};
} // namespace dolfinx_contact::condensed
