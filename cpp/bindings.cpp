// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The kernel on NumPy arrays. Arrays of any strides are read in place; the GIL is released in
// loops.
#include <dolfinx_contact/batch.h>

#include <optional>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <sstream>

namespace py = pybind11;
using namespace dolfinx_contact;

namespace {
using Array = py::array_t<double>;
using Branches = py::array_t<std::uint8_t>;

std::string shape_of(const py::array &array) { return py::str(array.attr("shape")); }

/// View of an array of `nodes` rows and N components, N = 0 for one number per node.
View<const double> view(const Array &array, const char *name, py::ssize_t nodes, int components) {
    const bool right = components == 0 ? array.ndim() == 1 && array.shape(0) == nodes
                                       : array.ndim() == 2 && array.shape(0) == nodes &&
                                             array.shape(1) == components;
    if (!right) {
        std::ostringstream message;
        message << name << " must have shape (" << nodes << ","
                << (components == 0 ? "" : " " + std::to_string(components)) << "), not "
                << shape_of(array);
        throw py::value_error(message.str());
    }
    constexpr auto size = static_cast<std::ptrdiff_t>(sizeof(double));
    for (int axis = 0; axis < array.ndim(); ++axis)
        if (array.strides(axis) % size != 0)
            throw py::value_error(std::string(name) +
                                  " must have strides that are multiples of 8 bytes");
    return {array.data(), array.strides(0) / size, components == 0 ? 0 : array.strides(1) / size};
}

py::ssize_t rows(const Array &array, const char *name) {
    if (array.ndim() == 0)
        throw py::value_error(std::string(name) + " must be an array with one row per node");
    return array.shape(0);
}

/// Law of known dimension, T tangential directions, and the number of nodes it is for.
template <int T> struct PyLaw {
    AnyLaw<T> any;
    std::optional<py::ssize_t> nodes; // none: any number

    static PyLaw make(const Array &mu, const std::optional<Array> &p) {
        const bool uniform = mu.ndim() == 1;
        if (!(uniform || mu.ndim() == 2) || mu.shape(mu.ndim() - 1) != T)
            throw py::value_error("mu must have shape (" + std::to_string(T) + ",) or (n, " +
                                  std::to_string(T) + "), not " + shape_of(mu));
        if (p &&
            (p->ndim() != mu.ndim() || !std::equal(mu.shape(), mu.shape() + mu.ndim(), p->shape())))
            throw py::value_error("p must have the shape of mu, " + shape_of(mu) + ", not " +
                                  shape_of(*p));
        const auto columns = [uniform](const Array &array) {
            std::vector<Tangent<T>> nodes(uniform ? 1 : static_cast<std::size_t>(array.shape(0)));
            for (std::size_t i = 0; i < nodes.size(); ++i)
                for (int j = 0; j < T; ++j)
                    nodes[i][j] = uniform ? array.at(j) : array.at(static_cast<py::ssize_t>(i), j);
            return nodes;
        };
        const auto coefficients = columns(mu);
        PyLaw law{make_law<T>(coefficients, p ? columns(*p) : coefficients, uniform), {}};
        if (!uniform)
            law.nodes = mu.shape(0);
        return law;
    }

    std::string kind() const {
        return std::visit(
            [](const auto &source) -> std::string {
                using Law = typename std::decay_t<decltype(source)>::Law;
                if constexpr (is_frictionless<Law>)
                    return "frictionless";
                else if constexpr (is_isotropic<Law>)
                    return "isotropic";
                else if constexpr (std::is_same_v<Law, Associated<T>>)
                    return "associated";
                else
                    return "nonassociated";
            },
            any);
    }

    std::size_t count(const Array &array, const char *name) const {
        const py::ssize_t n = rows(array, name);
        if (nodes && *nodes != n) {
            std::ostringstream message;
            message << name << " has " << n << " nodes, the law's coefficients " << *nodes;
            throw py::value_error(message.str());
        }
        return static_cast<std::size_t>(n);
    }

    /// Loop over nodes that writes one number per node.
    template <class Node> Array scalars(std::size_t n, Node node) const {
        Array out(static_cast<py::ssize_t>(n));
        double *values = out.mutable_data();
        py::gil_scoped_release release;
        std::visit(
            [&](const auto &source) {
                for_each_node(source, n,
                              [&](std::size_t i, const auto &law) { values[i] = node(i, law); });
            },
            any);
        return out;
    }

    /// Loop over nodes that writes a reaction and a branch per node.
    template <class Node> std::pair<Array, Branches> reactions(std::size_t n, Node node) const {
        Array out({static_cast<py::ssize_t>(n), static_cast<py::ssize_t>(T + 1)});
        Branches branches(static_cast<py::ssize_t>(n));
        double *r = out.mutable_data();
        std::uint8_t *branch = branches.mutable_data();
        {
            py::gil_scoped_release release;
            std::visit(
                [&](const auto &source) {
                    for_each_node(source, n, [&](std::size_t i, const auto &law) {
                        const Reaction<T> result = node(i, law);
                        for (int j = 0; j <= T; ++j)
                            r[i * (T + 1) + static_cast<std::size_t>(j)] = result.r[j];
                        branch[i] = static_cast<std::uint8_t>(result.branch);
                    });
                },
                any);
        }
        return {out, branches};
    }
};

template <int T> void bind_law(py::module_ &m, const char *name) {
    using Law = PyLaw<T>;
    constexpr int D = T + 1;
    py::class_<Law>(m, name)
        .def_property_readonly("kind", &Law::kind)
        .def_property_readonly("dim", [](const Law &) { return D; })
        .def_readonly("nodes", &Law::nodes)
        .def(
            "load_function",
            [](const Law &law, const Array &r) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D);
                return law.scalars(n, [=](std::size_t i, const auto &node) {
                    return load_function(node, load<D>(rv, i));
                });
            },
            py::arg("r").noconvert())
        .def(
            "project",
            [](const Law &law, const Array &tau) {
                const std::size_t n = law.count(tau, "tau");
                const auto tv = view(tau, "tau", tau.shape(0), D);
                return law.reactions(n, [=](std::size_t i, const auto &node) {
                    return project(node, load<D>(tv, i));
                });
            },
            py::arg("tau").noconvert())
        .def(
            "bipotential_map",
            [](const Law &law, const Array &r, const Array &gap, const Array &slip,
               const Array &rho) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D), sv = view(slip, "slip", r.shape(0), T),
                           gv = view(gap, "gap", r.shape(0), 0),
                           pv = view(rho, "rho", r.shape(0), 0);
                return law.reactions(n, [=](std::size_t i, const auto &node) {
                    return bipotential_map(node, load<D>(rv, i), gv(i), load<T>(sv, i), pv(i));
                });
            },
            py::arg("r").noconvert(), py::arg("gap").noconvert(), py::arg("slip").noconvert(),
            py::arg("rho").noconvert())
        .def(
            "scaled_map",
            [](const Law &law, const Array &r, const Array &gap, const Array &slip,
               const Array &rho) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D), sv = view(slip, "slip", r.shape(0), T),
                           gv = view(gap, "gap", r.shape(0), 0),
                           pv = view(rho, "rho", r.shape(0), 0);
                return law.reactions(n, [=](std::size_t i, const auto &node) {
                    return scaled_map(node, load<D>(rv, i), gv(i), load<T>(sv, i), pv(i));
                });
            },
            py::arg("r").noconvert(), py::arg("gap").noconvert(), py::arg("slip").noconvert(),
            py::arg("rho").noconvert())
        .def(
            "return_map",
            [](const Law &law, const Array &r, const Array &gap, const Array &slip,
               const Array &rho_n, const Array &rho_t) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D), sv = view(slip, "slip", r.shape(0), T),
                           gv = view(gap, "gap", r.shape(0), 0),
                           nv = view(rho_n, "rho_n", r.shape(0), 0),
                           tv = view(rho_t, "rho_t", r.shape(0), 0);
                return law.reactions(n, [=](std::size_t i, const auto &node) {
                    return return_map(node, load<D>(rv, i), gv(i), load<T>(sv, i), nv(i), tv(i));
                });
            },
            py::arg("r").noconvert(), py::arg("gap").noconvert(), py::arg("slip").noconvert(),
            py::arg("rho_n").noconvert(), py::arg("rho_t").noconvert())
        .def(
            "bipotential_gap",
            [](const Law &law, const Array &r, const Array &gap, const Array &slip) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D), sv = view(slip, "slip", r.shape(0), T),
                           gv = view(gap, "gap", r.shape(0), 0);
                return law.scalars(n, [=](std::size_t i, const auto &node) {
                    return bipotential_gap(node, load<D>(rv, i), gv(i), load<T>(sv, i));
                });
            },
            py::arg("r").noconvert(), py::arg("gap").noconvert(), py::arg("slip").noconvert())
        .def(
            "slip_defect",
            [](const Law &law, const Array &r, const Array &slip, const Branches &branch) {
                const std::size_t n = law.count(r, "r");
                const auto rv = view(r, "r", r.shape(0), D), sv = view(slip, "slip", r.shape(0), T);
                if (branch.ndim() != 1 || branch.shape(0) != r.shape(0))
                    throw py::value_error("branch must have shape (" + std::to_string(n) +
                                          ",), not " + shape_of(branch));
                const View<const std::uint8_t> bv{branch.data(), branch.strides(0), 0};
                return law.scalars(n, [=](std::size_t i, const auto &node) {
                    return slip_defect(node, load<D>(rv, i), load<T>(sv, i),
                                       static_cast<Branch>(bv(i)));
                });
            },
            py::arg("r").noconvert(), py::arg("slip").noconvert(), py::arg("branch").noconvert());
}
} // namespace

PYBIND11_MODULE(_kernel, m) {
    m.doc() = "Kernel of dolfinx_contact: friction law, cone and maps on NumPy arrays.";
    bind_law<1>(m, "Law2D");
    bind_law<2>(m, "Law3D");
    m.def(
        "make_law",
        [](const Array &mu, const std::optional<Array> &p, int dim) -> py::object {
            if (dim == 2)
                return py::cast(PyLaw<1>::make(mu, p));
            if (dim == 3)
                return py::cast(PyLaw<2>::make(mu, p));
            throw py::value_error("dim must be 2 or 3, not " + std::to_string(dim));
        },
        py::arg("mu"), py::arg("p"), py::arg("dim"));
}
