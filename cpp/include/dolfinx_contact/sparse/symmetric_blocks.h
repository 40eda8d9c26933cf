// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

namespace dolfinx_contact {

// A sparse symmetric matrix A = L + D + L^T in blocks of Size x Size: L below the diagonal blocks
// D. Products and sweeps of large matrices take the time in which these come from memory: half of
// the blocks, half of the time.
template <int Size> class SymmetricBlocks {
  public:
    static constexpr int Width = Size;
    using Block = Eigen::Matrix<double, Size, Size>;
    using Vector = Eigen::Matrix<double, Size, 1>;

    // From all its entries, row by row: values[k] stands in column `columns[k]` of row i, starts[i]
    // <= k < starts[i + 1], i < rows * Size. Blocks above the diagonal are not used.
    SymmetricBlocks(std::size_t rows, const std::int32_t *starts, const std::int32_t *columns,
                    const double *values)
        : diagonal_(rows, Block::Zero()), inverse_(rows), left_(rows) {
        const auto each = [&](std::size_t i, auto &&take) { // entries in the rows of block i
            for (int row = 0; row < Size; ++row) {
                const std::int32_t *ends = starts + i * Size + row;
                for (std::int32_t k = ends[0]; k < ends[1]; ++k)
                    take(std::size_t(columns[k] / Size), row, columns[k] % Size, values[k]);
            }
        };
        std::vector<std::size_t> last(rows, rows); // row of blocks where the column was met last
        std::size_t count = 0;
        for (std::size_t i = 0; i < rows; ++i)
            each(i, [&](std::size_t j, int, int, double) {
                count += j < i && last[j] != i ? 1 : 0;
                last[j] = i;
            });
        auto lower = std::make_shared<Lower>();
        lower->starts.reserve(rows + 1);
        lower->columns.reserve(count), lower->blocks.reserve(count); // not twice for a moment
        std::vector<std::size_t> place(rows, count); // of the last block in a column
        for (std::size_t i = 0; i < rows; ++i) {
            each(i, [&](std::size_t j, int row, int column, double value) {
                if (j == i)
                    diagonal_[i](row, column) += value;
                if (j >= i)
                    return;
                if (place[j] == count || place[j] < lower->starts.back()) {
                    place[j] = lower->columns.size();
                    lower->columns.push_back(std::uint32_t(j));
                    lower->blocks.push_back(Block::Zero());
                }
                lower->blocks[place[j]](row, column) += value;
            });
            lower->starts.push_back(lower->columns.size());
        }
        lower_ = lower;
        invert();
    }

    // This matrix with `blocks` added to those of its diagonal; what is below is shared.
    SymmetricBlocks plus(const double *blocks) const {
        SymmetricBlocks sum(*this);
        for (std::size_t i = 0; i < rows(); ++i)
            sum.diagonal_[i] += Given(blocks + i * Size * Size);
        sum.invert();
        return sum;
    }

    std::size_t rows() const { return diagonal_.size(); }

    // y = A x.
    void multiply(const double *x, double *y) const {
        const auto &[starts, columns, blocks] = *lower_;
        for (std::size_t i = 0; i < rows(); ++i) {
            const Vector own = at(x, i);
            Vector sum = diagonal_[i] * own;
            for (std::size_t k = starts[i]; k < starts[i + 1]; ++k) {
                sum += blocks[k] * at(x, columns[k]);
                at(y, columns[k]) += blocks[k].transpose() * own;
            }
            at(y, i) = sum;
        }
    }

    // The symmetric Gauss-Seidel sweep from zero: (D + L) D^-1 (D + L^T) x = b.
    void sweep(const double *b, double *x) {
        const auto &[starts, columns, blocks] = *lower_;
        for (std::size_t i = 0; i < rows(); ++i) {
            Vector left = at(b, i);
            for (std::size_t k = starts[i]; k < starts[i + 1]; ++k)
                left -= blocks[k] * at(x, columns[k]);
            left_[i] = left;
            at(x, i) = inverse_[i] * left;
        }
        for (std::size_t i = rows(); i-- > 0;) {
            const Vector found = inverse_[i] * left_[i];
            for (std::size_t k = starts[i]; k < starts[i + 1]; ++k)
                left_[columns[k]] -= blocks[k].transpose() * found;
            at(x, i) = found;
        }
    }

    // The diagonal blocks.
    const std::vector<Block> &diagonal() const { return diagonal_; }

  private:
    using Given = Eigen::Map<
        const Eigen::Matrix<double, Size, Size, Size == 1 ? Eigen::ColMajor : Eigen::RowMajor>>;
    template <class Real> static auto at(Real *x, std::size_t i) {
        using Values = std::conditional_t<std::is_const_v<Real>, const Vector, Vector>;
        return Eigen::Map<Values>(x + i * Size);
    }

    void invert() {
        for (std::size_t i = 0; i < rows(); ++i) {
            const double size = diagonal_[i].cwiseAbs().maxCoeff(); // determinants would overflow
            inverse_[i] = (diagonal_[i] / size).inverse() / size;
            if (!inverse_[i].allFinite()) // sweeps leave such unknowns as they are
                inverse_[i].setZero();
        }
    }

    struct Lower {
        std::vector<std::size_t> starts{0};
        std::vector<std::uint32_t> columns;
        std::vector<Block> blocks;
    };
    std::shared_ptr<const Lower> lower_;
    std::vector<Block> diagonal_, inverse_;
    std::vector<Vector> left_;
};
} // namespace dolfinx_contact
