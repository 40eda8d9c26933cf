// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// What the condensed solver's judge is made of: products in twice the precision, the law in
/// extended precision, inverses with tied rows.
#include "../random_states.h"
#include <dolfinx_contact/condensed/exact.h>
#include <dolfinx_contact/condensed/judge.h>
#include <dolfinx_contact/condensed/operator.h>
#include <dolfinx_contact/law/bipotential.h>
#include <dolfinx_contact/law/slip_rule.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using dolfinx_contact::condensed::MatrixXd;
using dolfinx_contact::condensed::Operator;
using dolfinx_contact::condensed::VectorXd;

// Products of all storages: W x, |W| |x|, W x in twice the precision where the terms cancel to
// nothing that a plain sum would keep, single entries.
TEST(CondensedJudge, products) {
    Random random(23);
    MatrixXd W = random.matrix(40, 40);
    W = MatrixXd(W + W.transpose());
    W /= 1.1 * W.cwiseAbs().maxCoeff(); // between a half and one, as it is kept
    MatrixXd unsymmetric = W;
    unsymmetric(2, 5) *= 1 + 1e-14;
    for (const auto &of : {W, unsymmetric}) {
        const Operator op(of, 1);
        const VectorXd x = random.vector(40);
        const VectorXd size = of.cwiseAbs() * x.cwiseAbs();
        EXPECT_LE((op.W().magnitudes(x) - size).norm(), 1e-14 * size.norm());
        const auto exact = [&](const VectorXd &start) {
            condensed::VectorXl sum = start.cast<long double>();
            for (int j = 0; j < 40; ++j)
                sum += of.col(j).cast<long double>() * static_cast<long double>(x[j]);
            return sum;
        };
        const VectorXd cancelled = -(of * x); // of which 1e-16 are left
        const auto left = op.W().accurate(cancelled, x);
        EXPECT_LE((left - exact(cancelled)).norm(), 1e-18L * size.norm());
        EXPECT_EQ(op.W()(7, 3), of(7, 3));
        EXPECT_EQ(op.W()(3, 7), of(3, 7));
    }
}

// The inverse of a matrix whose last rows make it indefinite, one of them with a zero diagonal.
TEST(CondensedJudge, inverse_with_tied_rows) {
    Random random(29);
    const MatrixXd B = random.matrix(152, 152);
    MatrixXd W = B * B.transpose() / 152 + MatrixXd::Identity(152, 152);
    W = MatrixXd(W + W.transpose()) / 2;
    W /= 1.1 * W.maxCoeff(); // between a half and one, as it is kept
    W(150, 150) = 0.0;
    W(151, 151) = -1e-9;
    Operator op(W, 3, 2);
    EXPECT_EQ(op.nodes(), 50);
    ASSERT_TRUE(op.prepare());
    EXPECT_LE((op.inverse()->dense() * W - MatrixXd::Identity(152, 152)).norm(), 1e-9);
    W.bottomRows(2).setZero();
    W.rightCols(2).setZero();
    EXPECT_FALSE(Operator(W, 3, 2).prepare());
}

// The judge's projection, in extended precision, is the solver's to rounding, on every branch.
TEST(CondensedJudge, judge_agrees_with_the_kernel) {
    Random random(31);
    int branches[3] = {0, 0, 0};
    const NonAssociated<2> law{{0.3, 0.15}, {1.0, 0.2}};
    for (int draw = 0; draw < 2000; ++draw) {
        condensed::ExactState<2> at;
        Local<2> r, w;
        for (int c = 0; c < 3; ++c) {
            r[c] = random.normal();
            w[c] = random.normal() * std::pow(10.0, random.uniform(-3.0, 1.0));
        }
        r = project(law, r).r;
        at.r = r.cast<long double>();
        at.w = w.cast<long double>();
        condensed::judge_exactly(law, 1.7L, at);
        const Tangent<2> w_t = w.head<2>();
        const Reaction<2> mapped = bipotential_map(law, r, w[2], w_t, 1.7);
        const double size = r.norm() + 1.7 * w.norm();
        EXPECT_EQ(at.branch, mapped.branch);
        EXPECT_LE((at.defect.cast<double>() - (r - mapped.r)).norm(), 1e-15 * size);
        const Tangent<2> slip = slip_defect(law, r, w_t, mapped.branch);
        if (!r.isZero(0.0)) {
            EXPECT_LE((at.slip.cast<double>() - slip).norm(), 1e-15 * size);
        }
        ++branches[static_cast<int>(at.branch)];
    }
    for (const int count : branches)
        EXPECT_GE(count, 100);
}

// A loose block, w = (r + s) / 2 over its plane, has to carry its weight, r = 1. However far away
// it is moved, where rounding hides that weight, a state without that reaction is no solution.
TEST(CondensedJudge, no_state_is_so_far_away_that_any_reaction_carries_the_load) {
    MatrixXd W = MatrixXd::Constant(2, 2, 0.5);
    W(1, 1) = 0.0;
    VectorXd q = VectorXd::Zero(2);
    q[1] = -0.5;
    const Operator op(W, 1, 1);
    const AnyLaw<0> law = Uniform<Frictionless>{};
    dolfinx_contact::condensed::Scales scales;
    scales.external = 1.0;
    const condensed::Judge<0> judge(op, law, q, scales, 1e-8);
    condensed::Solution state;
    const auto accepted = [&](double r, double s) {
        state.reaction = VectorXd::Zero(2);
        state.reaction << r, s;
        judge.judge(state);
        return condensed::Judge<0>::accepts(state, condensed::Options{});
    };
    EXPECT_TRUE(accepted(1.0, -1.0));
    for (double far = 1e-3; far < 1e30; far *= 10) {
        EXPECT_FALSE(accepted(5.0, far));
        EXPECT_FALSE(accepted(0.0, far));
        EXPECT_FALSE(accepted(0.0, -far));
    }
}
