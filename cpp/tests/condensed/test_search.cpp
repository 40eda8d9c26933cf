// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// The condensed problem w = q + W r: closed forms, and random problems whose answers are judged by
/// the law as the paper writes it, without the projection that the solver uses.
#include "../random_states.h"
#include <dolfinx_contact/condensed/problem.h>
#include <gtest/gtest.h>

using namespace dolfinx_contact;
using namespace dolfinx_contact::testing;
using dolfinx_contact::condensed::MatrixXd;
using dolfinx_contact::condensed::Operator;
using dolfinx_contact::condensed::Options;
using dolfinx_contact::condensed::Power;
using dolfinx_contact::condensed::Solution;
using dolfinx_contact::condensed::VectorXd;

namespace {
/// A condensed problem with a solution (r, w) put into it.
template <int T> struct Problem {
    MatrixXd W;
    VectorXd q, r, w;
    Tangent<T> mu, p;

    AnyLaw<T> law() const { return make_law<T>({mu}, {p}, true); }
    Operator op() const { return {W, T + 1}; }
    Solution solve(const Options &options = {}, const std::vector<VectorXd> &starts = {}) const {
        return condensed::solve<T>(op(), law(), q, starts, options);
    }
};

/// Direction of P^-2 r_t, against which the slip of [dSFMH07, Section 1] goes.
template <int T> Tangent<T> slip_direction(const Tangent<T> &r_t, const Tangent<T> &p) {
    return r_t.cwiseQuotient(p.cwiseAbs2()).normalized();
}

/// Every contact open, sticking or slipping, W = B B^T of a given rank.
template <int T>
Problem<T> random_problem(Random &random, int contacts, int rank, const Tangent<T> &mu,
                          const Tangent<T> &p) {
    constexpr int D = T + 1;
    Problem<T> problem;
    problem.mu = mu;
    problem.p = p;
    const MatrixXd B = random.matrix(D * contacts, rank);
    problem.W = B * B.transpose();
    const double length = problem.W.diagonal().mean();
    problem.r = problem.w = VectorXd::Zero(D * contacts);
    for (int i = 0; i < contacts; ++i) {
        auto r = problem.r.template segment<D>(D * i);
        auto w = problem.w.template segment<D>(D * i);
        Tangent<T> e;
        for (int c = 0; c < T; ++c)
            e[c] = random.normal();
        e.normalize();
        const int kind = random.below(3);
        if (kind == 0) {
            w[T] = length * random.uniform(0.1, 1.0);
            w.template head<T>() = length * e;
            continue;
        }
        r[T] = random.uniform(0.1, 1.0);
        r.template head<T>() =
            r[T] * (kind == 1 ? random.uniform(0.0, 0.95) : 1.0) * mu.cwiseProduct(e);
        if (kind == 2 && !mu.isZero(0.0))
            w.template head<T>() =
                -length * random.uniform(0.1, 1.0) * slip_direction<T>(r.template head<T>(), p);
    }
    problem.q = problem.w - problem.W * problem.r;
    return problem;
}

/// Largest violation of the law of [dSFMH07, Section 1], inequality by inequality, over the largest
/// load displacement or the largest reaction.
template <int T> double violation(const Problem<T> &problem, const VectorXd &reaction) {
    constexpr int D = T + 1;
    const VectorXd displacement = problem.q + problem.W * reaction;
    const double length = problem.q.template lpNorm<Eigen::Infinity>();
    const double force = reaction.template lpNorm<Eigen::Infinity>();
    double worst = 0.0;
    const auto at_least_zero = [&](double x) { worst = std::max(worst, -x); };
    for (int i = 0; i < reaction.size() / D; ++i) {
        const Local<T> r = reaction.segment<D>(D * i) / force;
        const Local<T> w = displacement.segment<D>(D * i) / length;
        at_least_zero(r[T]);
        at_least_zero(w[T]);
        worst = std::max(worst, std::min(std::abs(r[T]), std::abs(w[T])));
        const Tangent<T> r_t = r.template head<T>(), w_t = w.template head<T>();
        if (problem.mu.isZero(0.0)) {
            worst = std::max(worst, r_t.norm());
            continue;
        }
        const double inside = r[T] - r_t.cwiseQuotient(problem.mu).norm();
        at_least_zero(inside);
        if (r[T] > 0.0) { // either no slip, or slip against P^-2 r_t on the cone
            const Tangent<T> left = w_t + w_t.norm() * slip_direction<T>(r_t, problem.p);
            worst = std::max(worst, std::min(w_t.norm(), std::max(left.norm(), inside)));
        }
    }
    return worst;
}

template <int T> Tangent<T> constant(double value) { return Tangent<T>::Constant(value); }

/// All are solved, and the law holds; W regular or with more contacts than degrees of freedom.
template <int T> void solve_random(const Tangent<T> &mu, const Tangent<T> &p, bool regular) {
    Random random(11);
    for (int draw = 0; draw < 200; ++draw) {
        const int contacts = 1 + random.below(5), size = (T + 1) * contacts;
        const int rank = regular ? size : 1 + random.below(size);
        const auto problem = random_problem<T>(random, contacts, rank, mu, p);
        const Solution found = problem.solve();
        EXPECT_TRUE(found.converged) << draw << ": " << found.error;
        EXPECT_LE(violation(problem, found.reaction), 1e-6) << draw << " by " << found.branch;
    }
}
} // namespace

// A block on springs k_t, k_n is pushed by (d, -h): it sticks with k_t d, or slips with mu k_n h.
TEST(Condensed, sliding_block) {
    const double k_t = 3.0, k_n = 2.0, h = 0.5, mu = 0.2;
    Problem<2> block;
    block.mu = block.p = constant<2>(mu);
    block.W = Eigen::Vector3d(1 / k_t, 1 / k_t, 1 / k_n).asDiagonal();
    for (const double d : {0.0, 0.01, 0.06, 0.1, 3.0}) {
        block.q = Eigen::Vector3d(0.6 * d, 0.8 * d, -h);
        const Solution found = block.solve({1e-12, 1e-12});
        ASSERT_TRUE(found.converged);
        const double friction = std::min(k_t * d, mu * k_n * h);
        const Eigen::Vector3d expected(-0.6 * friction, -0.8 * friction, k_n * h);
        EXPECT_LE((found.reaction - expected).norm(), 1e-11);
        EXPECT_EQ(found.status[0], k_t * d > mu * k_n * h ? Branch::slip : Branch::stick);
    }
}

// The same from the functions alone, as docs/cpp.md shows it.
TEST(Condensed, example) {
    // docs/cpp.md begins
    const Eigen::Vector3d compliance(1 / 3.0, 1 / 3.0, 1 / 2.0); // mm/N: along the plane, normal
    const MatrixXd W = compliance.asDiagonal();
    const Eigen::Vector3d q(0.06, 0.08, -0.5); // mm: slip and gap without reactions
    const auto law = make_law<2>({{0.2, 0.2}}, {{1.0, 1.0}}, true); // mu, p, the same everywhere
    Options options;
    options.tol = 1e-10;
    const Operator op(W, 3); // three rows for each contact
    const Solution found = condensed::solve<2>(op, law, q, {}, options);
    // docs/cpp.md ends
    ASSERT_TRUE(found.converged);
    EXPECT_LE((found.reaction - Eigen::Vector3d(-0.12, -0.16, 1.0)).norm(), 1e-9);
    EXPECT_EQ(found.status[0], Branch::slip);
}

// All laws, regular and rank-deficient W, in three and two dimensions.
TEST(Condensed, isotropic) { solve_random<2>({0.3, 0.3}, {1.0, 1.0}, false); }
TEST(Condensed, associated) { solve_random<2>({0.3, 0.1}, {0.3, 0.1}, false); }
TEST(Condensed, non_associated) { solve_random<2>({0.3, 0.15}, {0.05, 0.2}, false); }
TEST(Condensed, strongly_non_associated) { solve_random<2>({0.4, 0.2}, {0.02, 1.0}, true); }
TEST(Condensed, frictionless) { solve_random<2>({0.0, 0.0}, {1.0, 1.0}, false); }
TEST(Condensed, in_the_plane) { solve_random<1>(constant<1>(0.4), constant<1>(1.0), false); }
TEST(Condensed, frictionless_in_the_plane) {
    solve_random<1>(constant<1>(0.0), constant<1>(1.0), false);
}

// A prepared operator eliminates sticking nodes by the inverse of W: same answer, where it is
// unique.
TEST(Condensed, inverse_changes_nothing) {
    Random random(3);
    for (int draw = 0; draw < 10; ++draw) {
        auto problem = random_problem<2>(random, 6, 18, {0.2, 0.1}, {0.2, 0.1});
        problem.W.diagonal().array() += problem.W.diagonal().mean();
        problem.q = problem.w - problem.W * problem.r;
        Operator prepared = problem.op();
        ASSERT_TRUE(prepared.prepare());
        const Options options{1e-12, 1e-12};
        const Solution found = condensed::solve<2>(prepared, problem.law(), problem.q, {}, options);
        ASSERT_TRUE(found.converged);
        EXPECT_LE((found.reaction - problem.r).norm(), 1e-9 * problem.r.norm());
        EXPECT_LE((problem.solve(options).reaction - problem.r).norm(), 1e-9 * problem.r.norm());
    }
    EXPECT_FALSE(Operator(MatrixXd::Ones(3, 3), 3).prepare()); // rank one
}

// A symmetric W shares an array with its inverse, others do not: both are W and its inverse, and
// the answers are the same.
TEST(Condensed, symmetric_and_unsymmetric_storage) {
    Random random(17);
    auto problem = random_problem<2>(random, 50, 150, {0.3, 0.15}, {0.05, 0.2});
    problem.W = MatrixXd(problem.W + problem.W.transpose()) / 2;
    problem.W.diagonal().array() += 2 * problem.W.diagonal().mean();
    problem.W = Power(Power::to_one(problem.W))(problem.W).eval(); // as it is kept
    problem.q = problem.w - problem.W * problem.r;
    auto changed = problem;
    changed.W(0, 1) *= 1 + 1e-14;
    const VectorXd x = random.vector(150);
    for (const auto &of : {problem, changed}) {
        Operator op = of.op();
        ASSERT_TRUE(op.prepare());
        EXPECT_EQ(op.W().symmetric(), of.W == of.W.transpose());
        EXPECT_TRUE(op.W().dense() == of.W);
        EXPECT_NEAR(op.W().norm(), of.W.cwiseAbs().colwise().sum().maxCoeff(),
                    1e-12 * op.W().norm());
        EXPECT_LE((op.W() * x - of.W * x).norm(), 1e-13 * op.W().norm() * x.norm());
        EXPECT_LE((of.W * (*op.inverse() * x) - x).norm(), 1e-11 * x.norm());
        EXPECT_LE((op.inverse()->dense() * of.W - MatrixXd::Identity(150, 150)).norm(), 1e-10);
        EXPECT_EQ(op.normal().dense()(3, 7), of.W(11, 23));
        const Solution found = condensed::solve<2>(op, of.law(), of.q, {}, {1e-12, 1e-12});
        ASSERT_TRUE(found.converged);
        EXPECT_LE((found.reaction - of.r).norm(), 1e-9 * of.r.norm());
    }
    problem.W.diagonal()[149] *= -1;
    EXPECT_FALSE(problem.op().prepare()); // symmetric, but not positive definite
}

// Without friction the normal rows of W alone give the same reactions as all of it.
TEST(Condensed, normal_components_alone) {
    Random random(19);
    const auto problem = random_problem<2>(random, 8, 24, {0.0, 0.0}, {1.0, 1.0});
    const auto rows = Eigen::seqN(2, 8, 3);
    Operator op(MatrixXd(problem.W(rows, rows)), 1);
    op.prepare();
    const AnyLaw<0> law = Uniform<Frictionless>{};
    const Solution found = condensed::solve<0>(op, law, problem.q(rows), {}, {1e-12, 1e-12});
    const Solution whole = problem.solve({1e-12, 1e-12});
    ASSERT_TRUE(found.converged && whole.converged);
    EXPECT_LE((found.reaction - whole.reaction(rows)).norm(), 1e-9 * whole.reaction.norm());
}

// Large enough for factors in single precision; started at the solution, nothing is left to do.
TEST(Condensed, many_contacts) {
    Random random(5);
    auto problem = random_problem<2>(random, 80, 240, {0.3, 0.15}, {0.05, 0.2});
    problem.W.diagonal().array() += 2 * problem.W.diagonal().mean();
    problem.W = Power(Power::to_one(problem.W))(problem.W).eval(); // as it is kept
    problem.q = problem.w - problem.W * problem.r;
    const Solution found = problem.solve();
    ASSERT_TRUE(found.converged);
    EXPECT_EQ(found.branch, "newton");
    EXPECT_LE(violation(problem, found.reaction), 1e-6);
    EXPECT_LE(problem.solve({}, {found.reaction}).iterations, 1);
}

// Nothing presses: no reactions, no iterations. No contact at all is no problem either.
TEST(Condensed, nothing_presses) {
    Random random(7);
    auto problem = random_problem<2>(random, 3, 9, {0.3, 0.2}, {0.3, 0.2});
    problem.q = VectorXd::Constant(9, 1.0);
    const Solution found = problem.solve();
    EXPECT_TRUE(found.converged);
    EXPECT_EQ(found.iterations, 0);
    EXPECT_TRUE(found.reaction.isZero(0.0));
    problem.W.resize(0, 0);
    problem.q.resize(0);
    EXPECT_TRUE(problem.solve().converged);
}

// Two contacts that push each other down have no solution: all is tried, none pretends.
TEST(Condensed, infeasible) {
    Problem<2> problem;
    problem.mu = problem.p = constant<2>(0.3);
    problem.W = MatrixXd::Zero(6, 6);
    problem.W(2, 2) = problem.W(5, 5) = 1.0;
    problem.W(2, 5) = problem.W(5, 2) = -1.0;
    problem.q = VectorXd::Zero(6);
    problem.q[2] = problem.q[5] = -1.0;
    const Solution found = problem.solve();
    EXPECT_FALSE(found.converged);
    EXPECT_GT(found.error, 1e-3);
    EXPECT_GE(found.tried.size(), 5u);
    for (const auto &attempt : found.tried)
        EXPECT_FALSE(attempt.converged);
}

// The caps on iterations and seconds end the search; without fallbacks there is one attempt.
TEST(Condensed, caps) {
    Random random(9);
    const auto problem = random_problem<2>(random, 6, 18, {0.9, 0.3}, {0.01, 1.0});
    Options options;
    options.max_iterations = 2;
    Solution found = problem.solve(options);
    EXPECT_FALSE(found.converged);
    EXPECT_LE(found.iterations, 2);
    options = {};
    options.max_seconds = 0.0;
    EXPECT_FALSE(problem.solve(options).converged);
    options = {};
    options.newton_iterations = 1;
    options.fallbacks = false;
    found = problem.solve(options);
    EXPECT_FALSE(found.converged);
    EXPECT_EQ(found.tried.size(), 1u);
}

// Whoever watches is told every iterate, and asked in every iteration whether to go on.
TEST(Condensed, watched) {
    Random random(9);
    const auto problem = random_problem<2>(random, 6, 18, {0.9, 0.3}, {0.01, 1.0});
    const Solution plain = problem.solve();
    Options options;
    int told = 0, asked = 0;
    double last = 1.0;
    options.monitor = [&](double error, const std::array<int, 3> &counts) {
        EXPECT_EQ(counts[0] + counts[1] + counts[2], 6);
        last = error;
        ++told;
    };
    options.heed = [&] { ++asked; };
    const Solution found = problem.solve(options);
    EXPECT_TRUE((found.reaction.array() == plain.reaction.array()).all());
    EXPECT_GE(told, found.iterations);
    EXPECT_GE(asked, found.iterations);
    EXPECT_LT(last, 1e-4);
    options.heed = [&] {
        if (--asked == 0)
            throw std::runtime_error("enough");
    };
    asked = 3;
    EXPECT_THROW(problem.solve(options), std::runtime_error);
}

// Nothing depends on time, addresses or the state of a random generator.
TEST(Condensed, the_same_bits_twice) {
    Random random(13);
    for (int draw = 0; draw < 10; ++draw) {
        const auto problem = random_problem<2>(random, 5, 9, {2.0, 0.5}, {0.05, 1.0});
        const Solution first = problem.solve(), second = problem.solve();
        EXPECT_EQ(first.iterations, second.iterations);
        EXPECT_TRUE((first.reaction.array() == second.reaction.array()).all());
    }
}
