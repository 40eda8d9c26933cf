// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// Contacts that close whatever the reactions are, made so by their geometry, are found and
/// refused with a proof, whatever the units; problems that are made of a solution never are.
#include "random_states.h"
#include <dolfinx_contact/condensed_feasibility.h>
#include <dolfinx_contact/condensed_judge.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using namespace dolfinx_contact::condensed;

namespace {
constexpr double coefficient = 0.7;
AnyLaw<2> isotropic() {
    return make_law<2>({coefficient * Tangent<2>::Ones()}, {coefficient * Tangent<2>::Ones()},
                       true);
}

bool excluded(const MatrixXd &W, const VectorXd &q) {
    const Operator op(W, 3);
    const AnyLaw<2> law = isotropic();
    const Options options;
    Budget budget{options};
    const VectorXd q_n = q(Eigen::seqN(2, op.nodes(), 3));
    return Judge<2>(op, law, q, {}, options.tol)
        .excludes(closing_forces(op, q_n, budget), options.tol);
}

/// H of contacts of bodies with so many motions, and y of some of them with H' y = 0 where all
/// others are zero.
struct Closed {
    MatrixXd H;
    VectorXd y;
    Closed(Random &random, Index nodes, Index motions, Index closed) {
        H = random.matrix(3 * nodes, motions);
        y = VectorXd::Zero(3 * nodes);
        for (Index i = 0; i < closed; ++i)
            y[3 * i + 2] = random.uniform(0.5, 1.5);
        const Index last = 3 * (closed - 1) + 2;
        const Eigen::RowVectorXd sum = y.transpose() * H;
        H.row(last) -= sum / y[last];
    }
};
} // namespace

TEST(CondensedFeasibility, ClosingContactsAreProved) {
    Random random(1);
    int cases = 0;
    for (const Index nodes : {2, 3, 10, 40, 90})
        for (const Index motions : {6, 12, 60})
            for (const double length : {1e-9, 1.0, 1e9})
                for (const double compliance : {1e-9, 1.0, 1e9}) {
                    const Closed bodies(random, nodes, motions, 2 + random.below(int(nodes) - 1));
                    VectorXd v = random.vector(motions), q = bodies.H * v;
                    q += 0.1 * random.vector(q.size());
                    const double work = q.dot(bodies.y), wanted = random.power(-2, 0);
                    q -= (work + wanted * bodies.y.sum()) / bodies.y.squaredNorm() * bodies.y;
                    const MatrixXd W = compliance * bodies.H * bodies.H.transpose();
                    EXPECT_TRUE(excluded(W, length * q)) << nodes << " " << motions;
                    Solution found =
                        solve<2>(Operator(W, 3), isotropic(), length * q, {}, Options{});
                    EXPECT_FALSE(found.converged);
                    EXPECT_TRUE(found.unsolvable);
                    EXPECT_EQ(found.closing.size(), nodes);
                    EXPECT_EQ(found.closing.maxCoeff(), 1.0);
                    EXPECT_GE(found.closing.minCoeff(), 0.0);
                    ++cases;
                }
    EXPECT_GT(cases, 100);
}

TEST(CondensedFeasibility, WhatHasASolutionIsNeverExcluded) {
    Random random(2);
    for (int k = 0; k < 300; ++k) {
        const Index nodes = 2 + random.below(40), motions = 3 + random.below(60);
        const Closed bodies(random, nodes, motions, 2 + random.below(int(nodes) - 1));
        const MatrixXd W = bodies.H * bodies.H.transpose();
        VectorXd r = VectorXd::Zero(3 * nodes), w = r;
        for (Index i = 0; i < nodes; ++i) { // open, sticking, slipping
            const Eigen::Vector2d t = Eigen::Vector2d(random.normal(), random.normal());
            const int state = random.below(3);
            const double size = random.power(-6, 3);
            if (state == 0)
                w.segment<3>(3 * i) << t, size;
            else
                r.segment<3>(3 * i) << coefficient * size * random.uniform() * t / t.norm(), size;
            if (state == 2) {
                r.segment<2>(3 * i) = -coefficient * size * t / t.norm();
                w.segment<2>(3 * i) = t;
            }
        }
        EXPECT_FALSE(excluded(W, w - W * r)) << k;
    }
}

TEST(CondensedFeasibility, NothingIsClaimedOfBodiesThatGiveWay) {
    Random random(3);
    const MatrixXd B = random.matrix(90, 90);
    const VectorXd q = VectorXd::Constant(90, -1.0);
    EXPECT_FALSE(excluded(B * B.transpose(), q));
    EXPECT_FALSE(excluded(MatrixXd::Zero(3, 3), VectorXd::Ones(3)));
    const Operator op(MatrixXd::Identity(3, 3), 3);
    const AnyLaw<2> law = isotropic();
    const VectorXd closing = VectorXd::Constant(3, -1.0);
    const Judge<2> judge(op, law, closing, {}, 1e-8);
    EXPECT_FALSE(judge.excludes({}, 1e-8));
    EXPECT_FALSE(judge.excludes(VectorXd::Ones(1), 1e-8)); // it moves the contact
}
