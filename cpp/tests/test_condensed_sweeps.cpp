// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// Sweeps and alternating directions: where contacts are coupled weakly they come to a solution of
/// the law, of unit friction, inequality by inequality, sweeps in a fixed order as in random ones,
/// dense or sparse, all contacts with friction or some without.
#include "random_states.h"
#include <dolfinx_contact/condensed_scaling.h>
#include <dolfinx_contact/condensed_solution.h>
#include <dolfinx_contact/condensed_splitting.h>
#include <dolfinx_contact/condensed_sweeps.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using namespace dolfinx_contact::condensed;

namespace {
void check(int seed, Index nodes, Index reach) {
    const Index size = 3 * nodes;
    Random random(static_cast<std::uint64_t>(seed));
    MatrixXd W = MatrixXd::Identity(size, size);
    for (Index i = 0; i < size; ++i)
        for (Index j = 0; j < i; ++j)
            if (i / 3 - j / 3 <= reach)
                W(i, j) = W(j, i) = 0.1 / static_cast<double>(3 * reach) * random.normal();
    const VectorXd q = random.vector(size);
    const Operator op(W, 3);
    const auto smooth = [&](Index i) { return seed % 2 == 1 && i % 4 == 0; };
    std::vector<Tangent<2>> mu;
    for (Index i = 0; i < nodes; ++i)
        mu.emplace_back((smooth(i) ? 0.0 : 1.0) * Tangent<2>::Ones());
    const std::vector<Tangent<2>> p(mu.size(), Tangent<2>::Ones());
    const AnyLaw<2> law = make_law<2>(mu, p, false);
    const System<2> system = Scaling<2, 2>(op, law, q).make();
    const Options options;
    Budget budget{options};
    std::minstd_rand order(static_cast<unsigned>(seed));
    Sweeps<2> sweeps(system);
    VectorXd r = VectorXd::Zero(size), shuffled = r;
    ASSERT_TRUE(sweeps.run(r, 1e-13, 1000, budget));
    ASSERT_TRUE(sweeps.run(shuffled, 1e-13, 1000, budget, &order));
    EXPECT_LT((shuffled - r).norm(), 1e-10 * r.norm()) << seed;
    for (const double rho : {0.01, 0.3}) {
        Splitting<2> splitting(system, rho);
        splitting.run(1e-13, 10000, budget);
        EXPECT_LT((splitting.reactions() - r).norm(), 1e-10 * r.norm()) << seed << " " << rho;
    }
    const VectorXd w = system.left.cwiseProduct(q + W * system.right.cwiseProduct(shuffled));
    for (Index i = 0; i < nodes; ++i) {
        const Eigen::Vector2d r_t = shuffled.segment<2>(3 * i), w_t = w.segment<2>(3 * i);
        const double r_n = shuffled[3 * i + 2], w_n = w[3 * i + 2], close = 1e-10;
        EXPECT_GE(std::min(r_n, w_n), -close);
        EXPECT_LT(std::min(r_n, w_n), close);
        EXPECT_LE(r_t.norm(), r_n + close);
        if (smooth(i)) {
            EXPECT_LT(r_t.norm(), close);
        } else if (r_n > close) {
            EXPECT_LT(std::abs(w_t.dot(r_t) + w_t.norm() * r_n), close);
        }
    }
}
} // namespace

TEST(CondensedSweeps, AnyOrderAndAlternatingDirectionsComeToTheLaw) {
    for (int seed = 1; seed <= 10; ++seed) {
        check(seed, 8, 8);
        check(seed, 100, 3);
    }
}
