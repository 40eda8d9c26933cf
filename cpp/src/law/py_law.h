// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// A law and the NumPy arrays it is called with: checked, read in place with any strides, the GIL
// released in loops.
#pragma once

#include <dolfinx_contact/law/batch.h>

#include <optional>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace dolfinx_contact;
using py::ssize_t;

using Array = py::array_t<double>;
using Branches = py::array_t<std::uint8_t>;

inline std::string text(const std::vector<ssize_t> &shape) {
    return py::str(py::tuple(py::cast(shape)));
}

inline std::vector<ssize_t> shape_of(const py::array &array) {
    return {array.shape(), array.shape() + array.ndim()};
}

/// View of `array` if it has this shape; else a ValueError with its name and both shapes.
template <class Scalar>
View<const Scalar> view(const char *name, const py::array_t<Scalar> &array,
                        const std::vector<ssize_t> &shape) {
    if (shape_of(array) != shape)
        throw py::value_error(std::string(name) + " must have shape " + text(shape) + ", not " +
                              text(shape_of(array)));
    constexpr auto size = static_cast<ssize_t>(sizeof(Scalar));
    bool aligned = reinterpret_cast<std::uintptr_t>(array.data()) % sizeof(Scalar) == 0;
    for (ssize_t axis = 0; axis < array.ndim(); ++axis)
        aligned = aligned && array.strides(axis) % size == 0;
    if (!aligned)
        throw py::value_error(std::string(name) + " must be aligned: give a contiguous copy");
    return {array.data(), array.strides(0) / size,
            array.ndim() > 1 ? array.strides(1) / size : ssize_t{0}};
}

/// Zeros, of which untouched pages cost nothing.
template <class Scalar> py::array_t<Scalar> zeros(const std::vector<ssize_t> &shape) {
    return py::module_::import("numpy").attr("zeros")(shape, py::dtype::of<Scalar>());
}

/// View of an array of ours: C order, one row per node.
template <class Scalar> View<Scalar> written(py::array_t<Scalar> &array) {
    constexpr auto size = static_cast<ssize_t>(sizeof(Scalar));
    return {array.mutable_data(), array.strides(0) / size, 1};
}

/// A law in T + 1 dimensions with what belongs to it for each node.
template <int T> struct PyLaw {
    static constexpr ssize_t D = T + 1;
    AnyLaw<T> any;
    std::optional<ssize_t> nodes; // none: any number
    std::optional<Array> axes;

    /// Views of the arguments of one call; the first of them says how many nodes there are.
    class Call {
      public:
        Call(const PyLaw &law, const char *name, const Array &r) : law(law) {
            if (r.ndim() == 0)
                throw py::value_error(std::string(name) + " must have one row per node");
            n = r.shape(0);
            if (law.nodes && *law.nodes != n)
                throw py::value_error(std::string(name) + " has " + std::to_string(n) +
                                      " nodes, the law's coefficients " +
                                      std::to_string(*law.nodes));
            in.tangents = T;
            in.r = view(name, r, {n, D});
            if (law.axes)
                in.axes = view("axes", *law.axes, {n, 2});
        }
        Call &gap(const Array &a) { return in.gap = view("gap", a, {n}), *this; }
        Call &slip(const Array &a) { return in.slip = view("slip", a, {n, ssize_t{T}}), *this; }
        Call &rho(const Array &a) { return in.rho_n = view("rho", a, {n}), *this; }
        Call &rho(const Array &normal, const Array &tangential) {
            in.rho_n = view("rho_n", normal, {n});
            in.rho_t = view("rho_t", tangential, {n});
            return *this;
        }
        Call &branch(const Branches &a) { return in.branch = view("branch", a, {n}), *this; }

        template <class F> Array number(F f) const {
            Array value(n);
            Outputs out;
            out.value = written(value);
            run(out, f);
            return value;
        }

        template <class F> Array tangential(F f) const {
            Array value = zeros<double>({n, ssize_t{T}});
            Outputs out;
            out.value = written(value);
            run(out, f);
            return value;
        }

        template <class F> std::pair<Array, Branches> reaction(F f) const {
            Array value = vectors();
            Branches branch(n);
            Outputs out;
            out.value = written(value);
            out.branch = written(branch);
            run(out, f);
            return {value, branch};
        }

        template <class F> std::tuple<Array, Branches, Array, Array> linearisation(F f) const {
            Array value = vectors(), by_reaction = zeros<double>({n, D, D}),
                  by_motion = zeros<double>({n, D, D});
            Branches branch(n);
            Outputs out;
            out.value = written(value);
            out.branch = written(branch);
            out.by_reaction = written(by_reaction);
            out.by_motion = written(by_motion);
            run(out, f);
            return {value, branch, by_reaction, by_motion};
        }

      private:
        const PyLaw &law;
        ssize_t n;
        Inputs in;

        Array vectors() const {
            const bool normal_only = std::holds_alternative<Uniform<Frictionless>>(law.any);
            return normal_only ? zeros<double>({n, D}) : Array({n, D});
        }

        template <class F> void run(const Outputs &out, F f) const {
            py::gil_scoped_release release;
            std::visit(
                [&](const auto &source) {
                    for_each_node(source, static_cast<std::size_t>(n), in, out, f);
                },
                law.any);
        }
    };
};

template <int T>
PyLaw<T> make_py_law(const Array &mu, const std::optional<Array> &p,
                     const std::optional<Array> &axes) {
    const bool uniform = mu.ndim() == 1;
    if (!(uniform || mu.ndim() == 2) || mu.shape(mu.ndim() - 1) != T)
        throw py::value_error("mu must have shape " + text({T}) + " or (n, " + std::to_string(T) +
                              "), not " + text(shape_of(mu)));
    if (p && shape_of(*p) != shape_of(mu))
        throw py::value_error("p must have the shape of mu, " + text(shape_of(mu)) + ", not " +
                              text(shape_of(*p)));
    const auto rows = [uniform](const Array &array) {
        std::vector<Tangent<T>> result(uniform ? 1U : static_cast<std::size_t>(array.shape(0)));
        for (std::size_t i = 0; i < result.size(); ++i)
            for (int j = 0; j < T; ++j)
                result[i][j] = uniform ? array.at(j) : array.at(static_cast<ssize_t>(i), j);
        return result;
    };
    const auto mu_rows = rows(mu);
    PyLaw<T> law{make_law<T>(mu_rows, p ? rows(*p) : mu_rows, uniform), {}, {}};
    if (!uniform)
        law.nodes = mu.shape(0);
    if (axes) {
        if (T == 1)
            throw py::value_error("axes have no meaning in two dimensions");
        view("axes", *axes, {uniform ? axes->shape(0) : mu.shape(0), 2});
        law.nodes = axes->shape(0);
        const bool turns = std::visit(
            [](const auto &source) {
                using Law = typename std::decay_t<decltype(source)>::Law;
                return Law::tangents == 2 && !is_isotropic<Law>;
            },
            law.any);
        if (turns) // others are the same in every direction
            law.axes = Array::ensure(axes->attr("copy")());
    }
    return law;
}
