// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// Levels of a graph couple to their neighbours alone, and factors by levels solve what dense
// factors of all entries solve: of matrices of one part and of several, symmetric and not, of any
// size of numbers. What they cannot solve they refuse, and the solver of sparse matrices takes
// other factors then.
#include "random_states.h"
#include <dolfinx_contact/condensed_levels.h>
#include <gtest/gtest.h>
#include <tuple>

using namespace dolfinx_contact::condensed;
using dolfinx_contact::testing::Random;

namespace {
struct Graph {
    const char *name;
    int unknowns;
    std::vector<std::pair<int, int>> edges;
};

/// Chains, a ring, a grid, a star, single unknowns, parts of each, and all coupled to all.
std::vector<Graph> graphs() {
    std::vector<Graph> found{{"one", 1, {}},          {"apart", 7, {}},  {"chain", 30, {}},
                             {"other chain", 30, {}}, {"ring", 31, {}},  {"grid", 48, {}},
                             {"star", 20, {}},        {"parts", 40, {}}, {"all", 12, {}}};
    const auto named = [&](const std::string &name) -> Graph & {
        return *std::find_if(found.begin(), found.end(),
                             [&](const Graph &g) { return g.name == name; });
    };
    for (int i = 0; i + 1 < 30; ++i) {
        named("chain").edges.emplace_back(i, i + 1);
        named("other chain").edges.emplace_back(7 * i % 30, 7 * (i + 1) % 30);
    }
    for (int i = 0; i < 31; ++i)
        named("ring").edges.emplace_back(i, (i + 7) % 31);
    for (int i = 0; i < 48; ++i) {
        if (i % 8 < 7)
            named("grid").edges.emplace_back(i, i + 1);
        if (i + 8 < 48)
            named("grid").edges.emplace_back(i, i + 8);
    }
    for (int i = 1; i < 20; ++i)
        named("star").edges.emplace_back(0, i);
    for (int i = 0; i + 3 < 39; ++i) // the last one has no other
        named("parts").edges.emplace_back(i, i + 3);
    for (int i = 0; i < 12; ++i)
        for (int j = 0; j < i; ++j)
            named("all").edges.emplace_back(i, j);
    return found;
}

/// Regular, with entries in both places of an edge; symmetric and positive definite, if asked for.
Sparse matrix(Random &random, const Graph &graph, bool symmetric) {
    MatrixXd A = MatrixXd::Zero(graph.unknowns, graph.unknowns);
    for (const auto &[i, j] : graph.edges) {
        A(i, j) = random.normal();
        A(j, i) = symmetric ? A(i, j) : random.normal();
    }
    for (int i = 0; i < graph.unknowns; ++i)
        A(i, i) = A.row(i).cwiseAbs().sum() + A.col(i).cwiseAbs().sum() + 0.1;
    Sparse found = A.sparseView(0.0, 0.0);
    found.makeCompressed();
    return found;
}
} // namespace

TEST(CondensedLevels, CoupleToTheNextAlone) {
    Random random(1);
    for (const Graph &graph : graphs()) {
        const Sparse A = matrix(random, graph, true);
        const Levels levels(A);
        std::vector<int> seen;
        double entries = 0.0;
        for (std::size_t k = 0; k < levels.count(); ++k) {
            ASSERT_GT(levels.size(k), 0) << graph.name;
            for (Index a = 0; a < levels.size(k); ++a) {
                const int i = levels.at(k)[static_cast<std::size_t>(a)];
                seen.push_back(i);
                EXPECT_EQ(levels.place(i).level, k) << graph.name;
                EXPECT_EQ(levels.place(i).within, a) << graph.name;
            }
            const auto size = static_cast<double>(levels.size(k));
            entries += size * size;
            entries += k > 0 ? 2.0 * size * static_cast<double>(levels.size(k - 1)) : 0.0;
        }
        EXPECT_EQ(levels.entries(), entries) << graph.name;
        std::sort(seen.begin(), seen.end());
        ASSERT_EQ(seen.size(), static_cast<std::size_t>(graph.unknowns)) << graph.name;
        for (int i = 0; i < graph.unknowns; ++i)
            EXPECT_EQ(seen[static_cast<std::size_t>(i)], i) << graph.name;
        for (const auto &[i, j] : graph.edges) {
            const auto a = levels.place(i).level, b = levels.place(j).level;
            EXPECT_LE(std::max(a, b) - std::min(a, b), 1U) << graph.name;
        }
    }
    const Graph chain = graphs()[2];
    EXPECT_EQ(Levels(matrix(random, chain, true)).count(), 30U); // from an end, wherever it began
}

TEST(CondensedLevels, FactorsSolve) {
    Random random(2);
    for (const Graph &graph : graphs())
        for (const bool symmetric : {true, false})
            for (const double scale : {1.0, 1e150, 1e-150}) {
                const Sparse A = scale * matrix(random, graph, symmetric);
                const VectorXd b = random.vector(graph.unknowns);
                const Levels levels(A);
                LevelFactors factors;
                for (int again = 0; again < 2; ++again) { // nothing is left of the last ones
                    ASSERT_TRUE(factors.factor(A, levels, symmetric)) << graph.name;
                    VectorXd x(b.size());
                    factors.solve(view(b), result(x));
                    const VectorXd exact = MatrixXd(A).fullPivLu().solve(b);
                    EXPECT_LE((x - exact).norm(), 1e-13 * exact.norm()) << graph.name;
                }
            }
}

TEST(CondensedLevels, RefuseWhatTheyCannotSolve) {
    Random random(3);
    const Graph grid = graphs()[5];
    Sparse A = matrix(random, grid, true);
    A.coeffRef(17, 17) *= -1.0;
    LevelFactors factors;
    EXPECT_FALSE(factors.factor(A, Levels(A), true));
    EXPECT_TRUE(factors.factor(A, Levels(A), false));
    Sparse one_way = matrix(random, graphs()[2], false); // of a chain, the ends coupled one way
    one_way.coeffRef(0, 29) = 1.0;
    one_way.makeCompressed();
    const Sparse chain = matrix(random, graphs()[2], false);
    EXPECT_FALSE(factors.factor(one_way, Levels(chain), false));
}

TEST(CondensedLevels, SolverOfSparseMatrices) {
    Random random(4);
    const auto solver = linear_algebra().solver();
    for (const Graph &graph : graphs())
        for (const bool symmetric : {true, false, true}) {
            const Sparse A = matrix(random, graph, symmetric);
            const VectorXd b = random.vector(graph.unknowns);
            VectorXd x;
            ASSERT_TRUE(solver->solve(A, b, x)) << graph.name;
            EXPECT_LE((A * x - b).norm(), 1e-13 * (A.norm() * x.norm() + b.norm())) << graph.name;
            EXPECT_GT(solver->fill(), 0.0);
            EXPECT_LE(solver->fill(), 2.0); // both factors, the diagonal twice
        }
    // a chain without pivots in its levels, of one unknown each
    MatrixXd swap = MatrixXd::Zero(8, 8);
    for (int i = 0; i + 1 < 8; ++i)
        std::tie(swap(i, i + 1), swap(i + 1, i)) = std::pair(random.normal(), random.normal());
    for (const double diagonal : {0.0, 1e-12}) {
        swap.diagonal().setConstant(diagonal);
        Sparse A = swap.sparseView(0.0, 0.0);
        A.makeCompressed();
        const VectorXd b = random.vector(8);
        VectorXd x;
        ASSERT_TRUE(solver->solve(A, b, x));
        EXPECT_LE((A * x - b).norm(), 1e-13 * (A.norm() * x.norm() + b.norm()));
    }
    Sparse singular = MatrixXd::Ones(3, 3).sparseView();
    singular.makeCompressed();
    VectorXd x;
    EXPECT_FALSE(solver->solve(singular, VectorXd::LinSpaced(3, 1.0, 2.0), x));
}
