// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file batch.h
/// The functions of one node, over all nodes of a contact: arrays with strides in, arrays out.
#pragma once

#include "bipotential.h"
#include "law.h"
#include "return_map.h"

namespace dolfinx_contact {
/// Element (i, j) of an array of any strided layout is data[i * row + j * column].
template <class Scalar> struct View {
    Scalar *data;
    std::ptrdiff_t row, column;
    Scalar &operator()(std::size_t i, int j = 0) const {
        return data[static_cast<std::ptrdiff_t>(i) * row + j * column];
    }
};

/// The T (or T + 1) components of node i.
template <int N> Eigen::Matrix<double, N, 1> load(const View<const double> &view, std::size_t i) {
    Eigen::Matrix<double, N, 1> v;
    for (int j = 0; j < N; ++j)
        v[j] = view(i, j);
    return v;
}

/// Calls node(i, law) for all nodes. Nothing in the loop asks which law it is.
template <class Source, class Node>
void for_each_node(const Source &source, std::size_t nodes, Node node) {
    for (std::size_t i = 0; i < nodes; ++i)
        node(i, source(i));
}
} // namespace dolfinx_contact
