// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// Symmetric sparse matrices on NumPy arrays.
#include <dolfinx_contact/sparse/symmetric_blocks.h>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <variant>

namespace py = pybind11;

namespace {
using dolfinx_contact::SymmetricBlocks;
using Integers = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;
using Reals = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Of one of the sizes of blocks.
class AnySize {
  public:
    AnySize(const Integers &starts, const Integers &columns, const Reals &values, int size)
        : matrix_(made(starts, columns, values, size)) {}

    AnySize plus(const Reals &blocks) const {
        return std::visit(
            [&blocks](const auto &A) {
                if (blocks.size() != size_of(A) * A.Width)
                    throw py::value_error("blocks must have shape (rows, size, size)");
                return AnySize(A.plus(blocks.data()));
            },
            matrix_);
    }
    Reals multiply(const Reals &x) const {
        return std::visit(
            [&x](const auto &A) {
                Reals y = like(A, x);
                A.multiply(x.data(), y.mutable_data());
                return y;
            },
            matrix_);
    }
    Reals sweep(const Reals &b) {
        return std::visit(
            [&b](auto &A) {
                Reals x = like(A, b);
                A.sweep(b.data(), x.mutable_data());
                return x;
            },
            matrix_);
    }
    Reals diagonal() const {
        return std::visit(
            [](const auto &A) {
                Reals found(size_of(A));
                double *next = found.mutable_data();
                for (const auto &block : A.diagonal())
                    for (const double value : block.diagonal())
                        *next++ = value;
                return found;
            },
            matrix_);
    }

  private:
    using Matrix = std::variant<SymmetricBlocks<1>, SymmetricBlocks<2>, SymmetricBlocks<3>>;
    explicit AnySize(Matrix matrix) : matrix_(std::move(matrix)) {}

    template <int Size> static py::ssize_t size_of(const SymmetricBlocks<Size> &A) {
        return py::ssize_t(A.rows()) * Size;
    }
    template <int Size> static Reals like(const SymmetricBlocks<Size> &A, const Reals &x) {
        if (x.ndim() != 1 || x.size() != size_of(A))
            throw py::value_error("a vector must have an entry for each row");
        return Reals(x.size());
    }
    static Matrix made(const Integers &starts, const Integers &columns, const Reals &values,
                       int size) {
        if (size < 1 || size > 3)
            throw py::value_error("blocks must have 1, 2 or 3 rows");
        if (starts.ndim() != 1 || starts.size() < 1 || (starts.size() - 1) % size != 0 ||
            columns.ndim() != 1 || values.ndim() != 1 || values.size() != columns.size())
            throw py::value_error("starts, columns and values must have one dimension, starts an "
                                  "entry more than rows of whole blocks, values one a column");
        const py::ssize_t rows = starts.size() - 1;
        for (py::ssize_t i = 0; i < rows; ++i)
            if (starts.at(i) < 0 || starts.at(i) > starts.at(i + 1) ||
                starts.at(i + 1) > columns.size())
                throw py::value_error("starts must rise from zero to the number of columns");
        for (py::ssize_t k = 0; k < columns.size(); ++k)
            if (columns.at(k) < 0 || columns.at(k) >= rows)
                throw py::value_error("columns must be numbers of rows");
        const auto n = std::size_t(rows / size);
        if (size == 1)
            return SymmetricBlocks<1>(n, starts.data(), columns.data(), values.data());
        if (size == 2)
            return SymmetricBlocks<2>(n, starts.data(), columns.data(), values.data());
        return SymmetricBlocks<3>(n, starts.data(), columns.data(), values.data());
    }

    Matrix matrix_;
};
} // namespace

void bind_sparse(py::module_ &m) {
    py::class_<AnySize>(m, "SymmetricBlocks",
                        "A symmetric matrix by its lower half, in blocks of up to 3 rows; those "
                        "above the diagonal are not used.")
        .def(py::init<const Integers &, const Integers &, const Reals &, int>(), py::arg("starts"),
             py::arg("columns"), py::arg("values"), py::arg("size"),
             "From rows of entries: starts of shape (rows * size + 1,), columns and values (m,).")
        .def("plus", &AnySize::plus, py::arg("blocks"),
             "The matrix with blocks of shape (rows, size, size) added to those of its diagonal; "
             "what is below takes no memory twice.")
        .def("multiply", &AnySize::multiply, py::arg("x"), "A x, shape (rows * size,).")
        .def("sweep", &AnySize::sweep, py::arg("b"),
             "x of a symmetric Gauss-Seidel sweep for A x = b from zero, shape (rows * size,).")
        .def("diagonal", &AnySize::diagonal, "The diagonal, shape (rows * size,).");
}
