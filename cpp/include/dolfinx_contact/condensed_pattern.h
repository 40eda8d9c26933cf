// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_pattern.h
/// The blocks of a sparse W that are not zero.
#pragma once

#include "condensed_matrix.h"
#include <algorithm>

namespace dolfinx_contact::condensed {
/// A sparse matrix by blocks of contacts: for each contact those that its reaction moves, in order.
class Pattern {
  public:
    Pattern(const Sparse &W, int dim)
        : dim_(dim), moved_(static_cast<std::size_t>(W.cols() / dim)), blocks_(moved_.size()) {
        std::vector<Index> place(moved_.size(), -1); // of a contact in the column
        for (std::size_t j = 0; j < moved_.size(); ++j) {
            auto &contacts = moved_[j];
            contacts.push_back(static_cast<Index>(j));
            for_column(W, j, [&](Index i, Index, double) { contacts.push_back(i); });
            std::sort(contacts.begin(), contacts.end());
            contacts.erase(std::unique(contacts.begin(), contacts.end()), contacts.end());
            blocks_[j].assign(contacts.size() * static_cast<std::size_t>(dim * dim), 0.0);
            for (std::size_t a = 0; a < contacts.size(); ++a)
                place[static_cast<std::size_t>(contacts[a])] = static_cast<Index>(a);
            for_column(W, j, [&](Index i, Index entry, double value) {
                const Index a = place[static_cast<std::size_t>(i)];
                blocks_[j][static_cast<std::size_t>(a * dim * dim + entry)] = value;
            });
            count_ += static_cast<Index>(contacts.size());
        }
    }

    const std::vector<Index> &moved_by(Index j) const { return moved_[of(j)]; }
    /// Of the a-th contact that j moves; of D = 1 the normal entry.
    template <int D> Eigen::Matrix<double, D, D> block(Index j, Index a) const {
        const Eigen::Map<const MatrixXd> whole(blocks_[of(j)].data() + a * dim_ * dim_, dim_, dim_);
        return whole.bottomRightCorner<D, D>();
    }
    Index blocks() const { return count_; }

  private:
    static std::size_t of(Index i) { return static_cast<std::size_t>(i); }
    /// action(contact, place in its block, value) for each entry of the columns of a contact.
    template <class Action>
    void for_column(const Sparse &W, std::size_t j, const Action &action) const {
        for (int k = 0; k < dim_; ++k)
            for (Sparse::InnerIterator at(W, dim_ * static_cast<Index>(j) + k); at; ++at)
                action(at.row() / dim_, dim_ * k + at.row() % dim_, at.value());
    }

    int dim_;
    std::vector<std::vector<Index>> moved_;
    std::vector<std::vector<double>> blocks_;
    Index count_ = 0;
};
} // namespace dolfinx_contact::condensed
