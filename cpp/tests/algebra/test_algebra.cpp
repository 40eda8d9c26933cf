// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// Each operation of the linear algebra gives what its formula gives, entry by entry in long double,
// whatever part of the matrix is stored; entries that are not stored are not read.
#include "../random_states.h"
#include <dolfinx_contact/algebra/square.h>
#include <gtest/gtest.h>
#include <limits>
#include <stdexcept>

using namespace dolfinx_contact::condensed;
using dolfinx_contact::testing::Random;
using MatrixXl = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;

namespace {
constexpr double not_stored = std::numeric_limits<double>::quiet_NaN();
constexpr Index sizes[] = {1, 2, 5, 64, 65, 150};

/// Multiples of 2^-24: sums of their products are exact in long double, but not in double.
MatrixXd short_numbers(const MatrixXd &A) {
    constexpr double unit = 1 << 24;
    return (A * unit).array().round() / unit;
}
MatrixXd symmetric(Random &random, Index size, double shift) {
    const MatrixXd half = random.matrix(size, size);
    return half * half.transpose() + shift * MatrixXd::Identity(size, size);
}

/// A with what is not of the part made NaN.
MatrixXd only(const MatrixXd &A, Part part) {
    MatrixXd found = A;
    for (Index j = 0; j < A.cols(); ++j) {
        const auto [first, last] = stored(part, j, A.rows());
        found.col(j).head(first).setConstant(not_stored);
        found.col(j).tail(A.rows() - last).setConstant(not_stored);
    }
    return found;
}

double difference(const VectorXl &found, const VectorXl &exact) {
    return static_cast<double>((found - exact).norm() / std::max(exact.norm(), Real(1e-300L)));
}
} // namespace

TEST(CondensedAlgebra, Products) {
    Random random(1);
    const LinearAlgebra &algebra = linear_algebra();
    for (const Index size : sizes)
        for (const Part part : {Part::all, Part::lower, Part::upper}) {
            const MatrixXd A = short_numbers(part == Part::all ? random.matrix(size, size)
                                                               : symmetric(random, size, 0.0) /
                                                                     static_cast<double>(size + 1));
            const MatrixXd given = only(A, part);
            const VectorXd x = short_numbers(random.vector(size)),
                           b = short_numbers(random.vector(size));
            VectorXd y = VectorXd::Constant(size, not_stored), low = VectorXd::Zero(size), high = b;
            algebra.multiply(view(given), part, view(x), result(y));
            const VectorXl exact = A.cast<Real>() * x.cast<Real>();
            EXPECT_LE(difference(y.cast<Real>(), exact), 1e-13);
            algebra.magnitudes(view(given), part, view(x), result(y));
            EXPECT_LE(
                difference(y.cast<Real>(), A.cwiseAbs().cast<Real>() * x.cwiseAbs().cast<Real>()),
                1e-13);
            algebra.multiply_accurately(view(given), part, view(x), result(high), result(low));
            const VectorXl wrong = high.cast<Real>() + low.cast<Real>() - b.cast<Real>() - exact;
            EXPECT_LE(static_cast<double>(wrong.norm()), 1e-18 * (b.norm() + y.norm()));
        }
}

TEST(CondensedAlgebra, Inverses) {
    Random random(3);
    const LinearAlgebra &algebra = linear_algebra();
    for (const Index size : sizes) {
        const MatrixXd one = MatrixXd::Identity(size, size), general = random.matrix(size, size);
        MatrixXd found = general;
        EXPECT_TRUE(algebra.invert(result(found), Part::all, 0));
        EXPECT_LE((found * general - one).norm(), 1e-10 * (1.0 + found.norm()));
        const Index tied = size / 5; // rows that make it indefinite
        MatrixXd A = symmetric(random, size, 1.0);
        A.bottomRightCorner(tied, tied) *= -1.0;
        found = only(A, Part::lower);
        ASSERT_TRUE(algebra.invert(result(found), Part::lower, tied));
        const MatrixXd whole = found.selfadjointView<Eigen::Lower>();
        EXPECT_LE((whole * A - one).norm(), 1e-10 * (1.0 + whole.norm()));
        if (size > tied) {
            A(0, 0) = -1.0;
            found = A;
            EXPECT_FALSE(algebra.invert(result(found), Part::lower, tied));
        }
    }
}

TEST(CondensedAlgebra, SolutionsOfRegularAndSingularSystems) {
    Random random(4);
    for (const Index size : {1, 3, 40, 127, 128, 200}) { // in single precision from 128 on
        const Poll poll;
        const auto solver = linear_algebra().solver(poll);
        MatrixXd J = random.matrix(size, size) + 10.0 * MatrixXd::Identity(size, size);
        const VectorXd rhs = random.vector(size);
        VectorXd y;
        for (const bool regularised : {false, true}) {
            ASSERT_TRUE(solver->solve(J, rhs, y, regularised));
            EXPECT_LE((J * y - rhs).norm(), 1e-10 * rhs.norm());
            EXPECT_LE((J * solver->again(rhs) - rhs).norm(), 1e-3 * rhs.norm());
        }
        if (size < 3)
            continue;
        J.row(1) = J.row(0);
        J.col(1) = J.col(0);
        const bool few = size < 128; // of many a singular one is refused
        EXPECT_EQ(solver->solve(J, rhs, y, false), few);
        if (few) { // stationary, and no part of it in the null space
            VectorXd null = VectorXd::Zero(size), shortest(size);
            null.head(2) << 1.0, -1.0;
            EXPECT_LE((J.transpose() * (J * y - rhs)).norm(), 1e-9 * J.norm() * rhs.norm());
            EXPECT_LE(std::abs(null.dot(y)), 1e-12 * y.norm());
            shortest = Eigen::CompleteOrthogonalDecomposition<MatrixXd>(J).solve(rhs);
            EXPECT_LE((shortest - y).norm(), 1e-10 * y.norm());
        }
    }
}

// A factorisation asks again and again whether to go on, ends at once if not, and is right if so.
TEST(CondensedAlgebra, FactorisationsCanBeEnded) {
    Random random(5);
    const MatrixXd J = random.matrix(700, 700);
    int asked = 0, most = 1'000'000;
    const Poll poll = [&] {
        if (++asked == most)
            throw std::runtime_error("enough");
    };
    const auto solver = linear_algebra().solver(poll);
    ASSERT_TRUE(solver->factor(J));
    const int times = asked;
    EXPECT_GE(times, 10);
    const VectorXd b = random.vector(700);
    EXPECT_LE((J * solver->again(b) - b).norm(), 1e-9 * b.norm());
    most = asked + times / 2;
    EXPECT_THROW(solver->factor(J), std::runtime_error);
    EXPECT_EQ(asked, most);
}
