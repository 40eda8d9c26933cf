// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file budget.h
/// Iterations and seconds that all methods share.
#pragma once

#include "problem.h"
#include "system.h"
#include <algorithm>
#include <array>
#include <chrono>

namespace dolfinx_contact::condensed {
/// Thrown out of a factorisation when the time is up.
struct OutOfTime {};

/// Iterations and seconds that all methods share.
struct Budget {
    using Clock = std::chrono::steady_clock;
    const Options &options;
    Clock::time_point start = Clock::now();
    int iterations = 0, limit = 0; // of the present method

    double seconds() const { return std::chrono::duration<double>(Clock::now() - start).count(); }
    bool late() const { return seconds() >= options.max_seconds; }
    bool over() const { return iterations >= options.max_iterations || late(); }
    /// A method that may take so many iterations.
    void begin(int most) { limit = iterations + std::min(most, options.max_iterations); }
    /// Asked in every iteration, so the place where others may end them.
    bool spent() const {
        if (options.heed)
            options.heed();
        return iterations >= limit || over();
    }

    /// The same between the products of a factorisation, which it ends.
    void poll() const {
        if (options.heed)
            options.heed();
        if (late())
            throw OutOfTime{};
    }

    /// The iterate r for who wants to see it, its residual over the largest reaction or one.
    template <int T> void tell(const State<T> &state, const VectorXd &r) const {
        if (!options.monitor)
            return;
        std::array<int, 3> counts{};
        for (const auto &point : state.points)
            ++counts[static_cast<std::size_t>(point.branch)];
        options.monitor(std::sqrt(2.0 * state.merit) /
                            std::max(1.0, r.template lpNorm<Eigen::Infinity>()),
                        counts);
    }
    template <int T> void tell(const System<T> &system, const VectorXd &r) const {
        if (!options.monitor)
            return;
        State<T> state;
        state.evaluate(system, r, system.displacement(r));
        tell(state, r);
    }
};
} // namespace dolfinx_contact::condensed
