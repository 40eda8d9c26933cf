// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// Products and sweeps by the lower half are those of the whole matrix, whatever stands above the
// diagonal.
#include "../random_states.h"
#include <dolfinx_contact/sparse/symmetric_blocks.h>
#include <gtest/gtest.h>
#include <limits>

using dolfinx_contact::SymmetricBlocks;
using dolfinx_contact::testing::Random;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {
/// A sparse symmetric positive definite matrix, and its entries; those above the diagonal are NaN.
template <int Size> struct Scene {
    int rows;
    MatrixXd A;
    std::vector<std::int32_t> starts{0}, columns;
    std::vector<double> values;

    Scene(Random &random, int n, double scale) : rows(n), A(MatrixXd::Zero(n * Size, n * Size)) {
        const auto block = [this](int i, int j) { return A.block<Size, Size>(Size * i, Size * j); };
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < i; ++j)
                if (random.below(3) == 0) {
                    block(i, j) = scale * random.matrix(Size, Size);
                    block(j, i) = block(i, j).transpose();
                }
        for (int i = 0; i < n; ++i) {
            const MatrixXd part = random.matrix(Size, Size);
            const double sum = A.middleRows(Size * i, Size).cwiseAbs().sum();
            block(i, i) = scale * (part * part.transpose() + MatrixXd::Identity(Size, Size)) +
                          sum * MatrixXd::Identity(Size, Size);
        }
        for (int i = 0; i < n * Size; ++i) {
            for (int j = 0; j < n * Size; ++j)
                // A row may miss a column of a block, and so the whole block.
                if (A(i, j) != 0.0 && (j / Size == i / Size || random.below(4) > 0)) {
                    columns.push_back(j);
                    values.push_back(j / Size > i / Size ? std::numeric_limits<double>::quiet_NaN()
                                                         : A(i, j));
                } else {
                    A(i, j) = j / Size > i / Size ? A(i, j) : 0.0;
                }
            starts.push_back(std::int32_t(columns.size()));
        }
        for (int i = 0; i < n * Size; ++i) // as below the diagonal blocks
            for (int j = (i / Size + 1) * Size; j < n * Size; ++j)
                A(i, j) = A(j, i);
    }
    SymmetricBlocks<Size> matrix() const {
        return {std::size_t(rows), starts.data(), columns.data(), values.data()};
    }

    /// Block diagonal, and what is below it.
    MatrixXd diagonal(const MatrixXd &of) const {
        MatrixXd D = MatrixXd::Zero(of.rows(), of.cols());
        for (int i = 0; i < rows; ++i)
            D.block<Size, Size>(Size * i, Size * i) = of.block<Size, Size>(Size * i, Size * i);
        return D;
    }
    MatrixXd lower(const MatrixXd &of) const {
        MatrixXd L = MatrixXd::Zero(of.rows(), of.cols());
        for (int i = 0; i < rows; ++i)
            L.block(Size * i, 0, Size, Size * i) = of.block(Size * i, 0, Size, Size * i);
        return L;
    }

    void check(SymmetricBlocks<Size> found, const MatrixXd &expected, const VectorXd &x) const {
        VectorXd y(x.size());
        found.multiply(x.data(), y.data());
        EXPECT_LE((y - expected * x).norm(), 1e-13 * (expected * x).norm());
        const MatrixXd D = diagonal(expected), L = lower(expected);
        found.sweep(x.data(), y.data());
        const VectorXd solved = (D + L) * D.inverse() * (D + L).transpose() * y;
        EXPECT_LE((solved - x).norm(), 1e-12 * x.norm());
    }
};

template <int Size> void run() {
    Random random(Size);
    for (const double scale : {1.0, 1e-150, 1e150})
        for (const int rows : {1, 2, 7, 40}) {
            const Scene<Size> scene(random, rows, scale);
            const VectorXd x = random.vector(rows * Size);
            scene.check(scene.matrix(), scene.A, x);
            MatrixXd springs = MatrixXd::Zero(rows * Size, rows * Size);
            std::vector<double> added;
            for (int i = 0; i < rows; ++i) {
                const MatrixXd half = random.matrix(Size, Size);
                springs.block<Size, Size>(Size * i, Size * i) = scale * half * half.transpose();
                for (int r = 0; r < Size; ++r)
                    for (int c = 0; c < Size; ++c)
                        added.push_back(springs(Size * i + r, Size * i + c));
            }
            const SymmetricBlocks<Size> before = scene.matrix();
            scene.check(before.plus(added.data()), scene.A + springs, x);
            scene.check(before, scene.A, x); // as it was
        }
}
} // namespace

TEST(SymmetricBlocks, Scalars) { run<1>(); }
TEST(SymmetricBlocks, PairsOfUnknowns) { run<2>(); }
TEST(SymmetricBlocks, TriplesOfUnknowns) { run<3>(); }

TEST(SymmetricBlocks, SweepsLeaveUnknownsWithoutStiffness) {
    const std::vector<std::int32_t> starts{0, 1, 3}, columns{0, 0, 1};
    const std::vector<double> values{0.0, 0.0, 2.0}, b{1.0, 4.0};
    std::vector<double> x(2);
    SymmetricBlocks<1>(2, starts.data(), columns.data(), values.data()).sweep(b.data(), x.data());
    EXPECT_EQ(x, (std::vector<double>{0.0, 2.0}));
}
