// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// W of low rank is the product that is found, whatever its units; one of full rank has none;
/// factors of W B + A by rank, of few entries and dense solve the same equations; and a sparse W is
/// the dense one, wherever its entries are.
#include "random_states.h"
#include <dolfinx_contact/condensed_blocks.h>
#include <dolfinx_contact/condensed_scaling.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using namespace dolfinx_contact::condensed;

namespace {
/// H G' of so many rows and rank, G = H but for a little; with `reach` rows couple to those nearby.
MatrixXd low_rank(Random &random, Index size, Index rank, double uneven, Index reach) {
    MatrixXd H(size, rank), G(size, rank);
    for (Index i = 0; i < size; ++i)
        for (Index j = 0; j < rank; ++j) {
            const bool near = std::abs(j * size / rank - i) < reach;
            H(i, j) = near ? random.normal() * random.power(-1, 1) : 0.0;
            G(i, j) = H(i, j) * (1.0 + uneven * random.normal());
        }
    return H * G.transpose();
}

void check_factors(int seed, Index reach, double units) {
    constexpr Index nodes = 80, size = 3 * nodes;
    Random random(static_cast<std::uint64_t>(seed));
    const MatrixXd W = units * low_rank(random, size, 60, seed % 2 * 1e-3, reach);
    const VectorXd q = random.vector(size);
    const Operator op(W, 3);
    const AnyLaw<2> law = make_law<2>({0.7 * Tangent<2>::Ones()}, {0.7 * Tangent<2>::Ones()}, true);
    const System<2> system = Scaling<2, 2>(op, law, q).make();
    ASSERT_TRUE(system.product->get() != nullptr);
    typename BlockSolver<2>::Blocks A, B;
    MatrixXd J = system.left.asDiagonal() * W * system.right.asDiagonal();
    for (Index i = 0; i < nodes; ++i) { // open, slipping and sticking contacts: large to small
        Eigen::Matrix3d M = Eigen::Matrix3d::NullaryExpr([&] { return random.normal(); });
        A.emplace_back(random.power(-6, 2) *
                       (M * M.transpose() + 0.1 * Eigen::Matrix3d::Identity()));
        B.emplace_back(Eigen::Matrix3d::Identity() + 0.1 * M);
        J.middleCols<3>(3 * i) = (J.middleCols<3>(3 * i) * B.back()).eval();
        J.block<3, 3>(3 * i, 3 * i) += A.back();
    }
    BlockSolver<2> solver(system);
    for (int time = 0; time < 3; ++time) { // of few entries first, where W is sparse
        ASSERT_TRUE(solver.factor(A, &B));
        const VectorXd rhs = random.vector(size);
        EXPECT_LT((J * solver.solve(rhs) - rhs).norm(), 1e-8 * rhs.norm()) << seed << " " << time;
    }
}
} // namespace

TEST(CondensedRank, AProductIsFoundWhereTheRankIsLow) {
    Random random(1);
    for (const Index size : {3, 30, 150, 450}) // of the last one in several panels
        for (const double uneven : {0.0, 1e-3})
            for (const double units : {1e-12, 1.0, 1e12}) {
                const MatrixXd W = units * low_rank(random, size, size / 3, uneven, size);
                const auto part = uneven > 0.0 ? Part::all : Part::upper;
                const Square view(W.data(), size, size, part);
                const auto found = product(view, 0.6);
                ASSERT_TRUE(found.has_value()) << size << " " << uneven;
                EXPECT_EQ(found->X.rows(), size / 3);
                EXPECT_LT((found->C * found->X - W).norm(), 1e-9 * W.norm());
                EXPECT_FALSE(product(view, 0.2).has_value());
            }
}

TEST(CondensedRank, NoProductOfFullRankOrNone) {
    Random random(2);
    const MatrixXd regular = low_rank(random, 30, 30, 0.0, 30), zero = MatrixXd::Zero(3, 3);
    EXPECT_FALSE(product({regular.data(), 30, 30, Part::all}, 0.6).has_value());
    EXPECT_FALSE(product({zero.data(), 3, 3, Part::all}, 0.6).has_value());
    MatrixXd indefinite = zero; // has a product, but not by pivots on the diagonal
    indefinite(0, 1) = indefinite(1, 0) = indefinite(2, 2) = 1.0;
    EXPECT_FALSE(product({indefinite.data(), 3, 3, Part::all}, 0.6).has_value());
}

TEST(CondensedRank, AllFactorsSolve) {
    for (int seed = 1; seed <= 10; ++seed)
        for (const double units : {1e-9, 1.0, 1e9}) {
            check_factors(seed, 240, units);
            check_factors(seed, 6, units);
        }
}

TEST(CondensedRank, SparseFactorsOfOneMatrixAfterTheOther) {
    Random random(3);
    const auto solver = linear_algebra().solver();
    for (const Index reach : {2, 2, 5, 2, 5, 5}) { // the same places as before, and others
        constexpr Index size = 60;
        MatrixXd J = low_rank(random, size, size, 0.1, reach);
        J.diagonal().array() += 1.0;
        const VectorXd rhs = random.vector(size);
        ASSERT_TRUE(solver->factor(Eigen::SparseMatrix<double>(J.sparseView())));
        EXPECT_LT((J * solver->again(rhs) - rhs).norm(), 1e-9 * rhs.norm()) << reach;
    }
}

namespace {
/// An operator of W, which is sparse, and its views are those of the dense one.
void check_sparse(const Operator &op, const MatrixXd &W, Random &random) {
    const Index nodes = op.nodes(), size = W.rows();
    ASSERT_TRUE(op.pattern() != nullptr);
    Index blocks = 0;
    for (Index j = 0; j < nodes; ++j) {
        std::vector<Index> expected;
        for (Index i = 0; i < nodes; ++i)
            if (i == j || !W.block<3, 3>(3 * i, 3 * j).isZero(0.0)) {
                EXPECT_EQ(op.pattern()->block<3>(j, static_cast<Index>(expected.size())),
                          (W.block<3, 3>(3 * i, 3 * j)));
                EXPECT_EQ(op.pattern()->block<1>(j, static_cast<Index>(expected.size())).value(),
                          W(3 * i + 2, 3 * j + 2));
                expected.push_back(i);
            }
        EXPECT_EQ(op.pattern()->moved_by(j), expected) << j;
        blocks += static_cast<Index>(expected.size());
    }
    EXPECT_EQ(op.pattern()->blocks(), blocks);
    EXPECT_EQ(op.W().symmetric(), W == W.transpose());
    EXPECT_EQ(op.W().dense(), W);
    EXPECT_EQ(op.W().diagonal(), W.diagonal());
    EXPECT_EQ(op.W().block<3>(1, 2), (W.block<3, 3>(3, 6)));
    EXPECT_EQ(op.W()(4, 7), W(4, 7));
    EXPECT_NEAR(op.W().norm(), W.cwiseAbs().colwise().sum().maxCoeff(), 1e-14 * op.W().norm());
    const auto normal = Eigen::seqN(Index{2}, nodes, Index{3});
    EXPECT_EQ(op.normal().dense(), W(normal, normal));
    EXPECT_NEAR(op.mean_normal(), W.diagonal()(normal).cwiseAbs().mean(), 1e-14 * W.norm());
    const VectorXd x = random.vector(size), b = -W * x;
    const double rounding = 1e-15 * (W.cwiseAbs() * x.cwiseAbs()).norm();
    EXPECT_LT((op.W() * x - W * x).norm(), 10.0 * rounding);
    EXPECT_LT((op.W().magnitudes(x) - W.cwiseAbs() * x.cwiseAbs()).norm(), 10.0 * rounding);
    const VectorXl exact = W.cast<Real>() * x.cast<Real>() + b.cast<Real>();
    EXPECT_LT((op.W().accurate(b, x) - exact).norm(), 1e-3 * rounding);
}
} // namespace

TEST(CondensedRank, ASparseMatrixIsTheDenseOne) {
    constexpr Index nodes = 100, size = 3 * nodes;
    Random random(4);
    for (const double uneven : {0.0, 1e-3}) {
        MatrixXd W = low_rank(random, size, size / 3, uneven, 4);
        W.topLeftCorner(60, 60) += low_rank(random, 60, 20, uneven, 60); // some contacts have many
        if (uneven == 0.0)
            W = MatrixXd(W + W.transpose());
        W /= 1.1 * W.cwiseAbs().maxCoeff(); // between a half and one, as it is kept
        check_sparse(Operator(W, 3), W, random);
        check_sparse(Operator(Sparse(W.sparseView(0.0, 0.0)), 3), W, random);
        const Operator few(Sparse(W.topLeftCorner(30, 30).sparseView()), 3); // few contacts
        EXPECT_TRUE(few.pattern() == nullptr);
        EXPECT_EQ(few.W().dense(), W.topLeftCorner(30, 30));
        const auto found = product(Operator(W, 3).W(), 0.6);
        ASSERT_TRUE(found.has_value());
        EXPECT_LT((found->C * found->X - W).norm(), 1e-9 * W.norm());
    }
    EXPECT_TRUE(Operator(MatrixXd::Ones(size, size), 3).pattern() == nullptr);
    EXPECT_TRUE(Operator(Sparse(MatrixXd::Ones(size, size).sparseView()), 3).pattern() == nullptr);
}

TEST(CondensedRank, TheInverseOfASparseMatrix) {
    constexpr Index size = 300;
    Random random(5);
    MatrixXd W = low_rank(random, size, size / 3, 0.0, 4);
    Operator singular(Sparse(W.sparseView()), 3);
    EXPECT_FALSE(singular.prepare());
    EXPECT_TRUE(singular.inverse() == nullptr);
    W.diagonal().array() += 1.0;
    W /= 1.1 * W.cwiseAbs().maxCoeff(); // as it is kept
    Operator regular(Sparse(W.sparseView()), 3);
    ASSERT_TRUE(regular.prepare());
    EXPECT_LT((regular.inverse()->dense() * W - MatrixXd::Identity(size, size)).norm(), 1e-8);
}
