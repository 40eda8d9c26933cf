// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// The smoothed problem of condensed_path.h: its derivatives against differences, on sticking,
/// slipping and open contacts alike.
#include "random_states.h"
#include <dolfinx_contact/condensed_path.h>
#include <dolfinx_contact/condensed_scaling.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using namespace dolfinx_contact::condensed;

namespace {
template <int T> void check(int seed, bool sparse) {
    constexpr Index D = T + 1, nodes = 12, size = D * nodes;
    Random random(static_cast<std::uint64_t>(seed));
    MatrixXd B = random.matrix(size, size / 2);
    if (sparse) // chains of two contacts
        for (Index i = 0; i < size; ++i)
            for (Index j = 0; j < size / 2; ++j)
                B(i, j) *= i / (2 * D) == j / D;
    const VectorXd q = random.vector(size);
    const Operator op(B * B.transpose(), T + 1);
    const AnyLaw<T> law = make_law<T>({0.7 * Tangent<T>::Ones()}, {0.7 * Tangent<T>::Ones()}, true);
    const System<T> system = Scaling<T, T>(op, law, q).make();
    std::minstd_rand starts(static_cast<unsigned>(seed));
    Smoothed<T> at(system, random_start<T>(starts, nodes, 0), starts);
    for (const auto part : {Smoothed<T>::Part::correction, Smoothed<T>::Part::smoothing}) {
        at.part = part;
        VectorXd x = at.start;
        x[size] = 0.3 * at.root;
        at.evaluate(x);
        ASSERT_TRUE(at.factors());
        const VectorXd rest = at.rest, by_s = at.by_s, dz = at.solution(rest);
        const double scale = rest.norm(), h = 1e-6;
        const auto difference = [&](const VectorXd &dx) {
            at.evaluate(x + h * dx);
            const VectorXd after = at.rest;
            at.evaluate(x - h * dx);
            return VectorXd((after - at.rest) / (2.0 * h));
        };
        VectorXd dx = VectorXd::Zero(size + 1);
        dx.head(size) = dz / dz.norm();
        EXPECT_LT((difference(dx) + rest / dz.norm()).norm(), 1e-5 * scale) << seed;
        dx = at.root * VectorXd::Unit(size + 1, size);
        EXPECT_LT((difference(dx) - by_s).norm(), 1e-5 * std::max(1.0, by_s.norm())) << seed;
    }
}
} // namespace

TEST(CondensedPath, DerivativesAreThoseOfDifferences) {
    for (int seed = 1; seed <= 20; ++seed) {
        check<1>(seed, false);
        check<2>(seed, false);
        check<2>(seed, true);
    }
}
