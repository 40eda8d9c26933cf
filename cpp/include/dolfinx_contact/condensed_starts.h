// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed_starts.h
/// Random reactions to start from, the same in every run and on every machine.
#pragma once

#include "condensed_system.h"
#include <random>

namespace dolfinx_contact::condensed {
inline double uniform(std::minstd_rand &random) {
    return static_cast<double>(random() - std::minstd_rand::min()) /
           static_cast<double>(std::minstd_rand::max() - std::minstd_rand::min());
}

/// Ten to a power between two, all alike probable.
inline double power_of_ten(std::minstd_rand &random, double low, double high) {
    return std::pow(10.0, low + (high - low) * uniform(random));
}

/// Scaled reactions in the cone, of any size about one; those of tied rows are zero.
template <int T> VectorXd random_start(std::minstd_rand &random, Index nodes, Index tied) {
    constexpr int D = T + 1;
    VectorXd r = VectorXd::Zero(D * nodes + tied);
    const double size = power_of_ten(random, -1.0, 1.0);
    for (Index i = 0; i < nodes; ++i) {
        const double normal = uniform(random) < 0.3 ? 0.0 : size * uniform(random);
        r[D * i + T] = normal;
        for (int c = 0; c < T; ++c)
            r[D * i + c] = normal * (1.4 * uniform(random) - 0.7);
    }
    return r;
}
} // namespace dolfinx_contact::condensed
