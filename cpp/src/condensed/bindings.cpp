// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The condensed contact problem on NumPy arrays. The GIL is released while it is solved.
#include <dolfinx_contact/condensed/problem.h>

#include <chrono>
#include <memory>
#include <optional>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace py = pybind11;
using namespace dolfinx_contact;
using namespace dolfinx_contact::condensed;

namespace {
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

VectorXd vector(const Array &array, Index size, const char *name) {
    if (array.size() != size)
        throw py::value_error(std::string(name) + " must have " + std::to_string(size) +
                              " entries, not " + std::to_string(array.size()));
    return Eigen::Map<const VectorXd>(array.data(), size);
}

void check_size(Index rows, Index columns, int dim, Index tied) {
    if (dim < 1 || dim > 3)
        throw py::value_error("dim must be 1, 2 or 3, not " + std::to_string(dim));
    if (rows != columns || tied < 0 || rows < tied || (rows - tied) % dim != 0)
        throw py::value_error("W must be square with " + std::to_string(dim) +
                              " rows per contact and one per tied row");
}

/// Of an extension compiled for more instructions, else of this one.
using Algebra = std::optional<py::capsule>;

template <class Matrix>
std::unique_ptr<Operator> checked_operator(const Matrix &W, int dim, Index tied,
                                           const Algebra &algebra) {
    for (Index i = dim - 1; i < W.rows() - tied; i += dim)
        if (W.coeff(i, i) < 0.0)
            throw py::value_error("W has a negative normal diagonal entry: a contact must give way "
                                  "to its reaction");
    const LinearAlgebra *chosen = &linear_algebra();
    if (algebra)
        chosen = static_cast<const LinearAlgebra *>(
            PyCapsule_GetPointer(algebra->ptr(), "dolfinx_contact.LinearAlgebra"));
    if (chosen == nullptr)
        throw py::error_already_set(); // another capsule: ValueError
    return std::make_unique<Operator>(W, dim, tied, *chosen);
}

std::unique_ptr<Operator> make_operator(const Array &W, int dim, Index tied,
                                        const Algebra &algebra) {
    check_size(W.ndim() == 2 ? W.shape(0) : -1, W.ndim() == 2 ? W.shape(1) : 0, dim, tied);
    return checked_operator(Eigen::Map<const RowMajor>(W.data(), W.shape(0), W.shape(1)), dim, tied,
                            algebra);
}

VectorXd optional(const std::optional<Array> &array) {
    return array ? Eigen::Map<const VectorXd>(array->data(), array->size()) : VectorXd();
}

template <int T> AnyLaw<T> law(const Array &mu, const std::optional<Array> &p, Index nodes) {
    const bool uniform = mu.ndim() == 1;
    const Index count = uniform ? 1 : nodes;
    const VectorXd mu_values = vector(mu, T * count, "mu"),
                   p_values = p ? vector(*p, T * count, "p") : mu_values;
    std::vector<Tangent<T>> coefficients, rule;
    for (Index i = 0; i < count; ++i) {
        coefficients.emplace_back(mu_values.segment<T>(T * i));
        rule.emplace_back(p_values.segment<T>(T * i));
    }
    return make_law<T>(coefficients, rule, uniform);
}

/// Lets Python answer signals, Ctrl-C among them; what their handlers raise ends the search.
std::function<void()> heed_signals() {
    using Clock = std::chrono::steady_clock;
    return [last = Clock::now()]() mutable {
        const auto now = Clock::now();
        if (now - last < std::chrono::milliseconds(Tuning::signals_every))
            return;
        last = now;
        const py::gil_scoped_acquire acquire;
        if (PyErr_CheckSignals() != 0)
            throw py::error_already_set();
    };
}

Solution solve_any(const Operator &op, const Array &mu, const std::optional<Array> &p,
                   const Array &q, const std::vector<Array> &starts, const Options &options) {
    const Index size = op.W().size();
    const VectorXd free = vector(q, size, "q");
    std::vector<VectorXd> from;
    for (const Array &start : starts)
        from.push_back(vector(start, size, "a start"));
    if (op.dim() == 1) {
        const AnyLaw<0> any = Uniform<Frictionless>{};
        const py::gil_scoped_release release;
        return solve<0>(op, any, free, from, options);
    }
    if (op.dim() == 2) {
        const auto any = law<1>(mu, p, op.nodes());
        const py::gil_scoped_release release;
        return solve<1>(op, any, free, from, options);
    }
    const auto any = law<2>(mu, p, op.nodes());
    const py::gil_scoped_release release;
    return solve<2>(op, any, free, from, options);
}

/// Components of contacts, (n, dim), without tied rows.
py::array_t<double> per_contact(const Solution &s, const VectorXd &v) {
    const auto n = static_cast<py::ssize_t>(s.status.size());
    const auto size = static_cast<py::ssize_t>(v.size()) - s.tied;
    py::array_t<double> out({n, n == 0 ? 0 : size / n});
    std::copy(v.begin(), v.begin() + size, out.mutable_data());
    return out;
}
} // namespace

void bind_condensed(py::module_ &m) {
    py::class_<Attempt>(m, "CondensedAttempt")
        .def_readonly("branch", &Attempt::branch)
        .def_readonly("converged", &Attempt::converged)
        .def_readonly("iterations", &Attempt::iterations)
        .def_readonly("seconds", &Attempt::seconds)
        .def_readonly("error", &Attempt::error)
        .def_readonly("slip_error", &Attempt::slip_error);
    py::class_<Solution>(m, "CondensedSolution")
        .def_property_readonly("reaction",
                               [](const Solution &s) { return per_contact(s, s.reaction); })
        .def_property_readonly("displacement",
                               [](const Solution &s) { return per_contact(s, s.displacement); })
        .def_property_readonly("tied",
                               [](const Solution &s) {
                                   py::array_t<double> out(s.tied);
                                   std::copy(s.reaction.end() - s.tied, s.reaction.end(),
                                             out.mutable_data());
                                   return out;
                               })
        .def_property_readonly(
            "status",
            [](const Solution &s) {
                py::array_t<std::uint8_t> out(static_cast<py::ssize_t>(s.status.size()));
                for (std::size_t i = 0; i < s.status.size(); ++i)
                    out.mutable_data()[i] = static_cast<std::uint8_t>(s.status[i]);
                return out;
            })
        .def_readonly("error", &Solution::error)
        .def_readonly("slip_error", &Solution::slip_error)
        .def_readonly("local_error", &Solution::local_error)
        .def_property_readonly(
            "rounding", [](const Solution &s) { return std::max(s.rounding, s.slip_rounding); })
        .def_readonly("change", &Solution::change)
        .def_readonly("iterations", &Solution::iterations)
        .def_readonly("seconds", &Solution::seconds)
        .def_readonly("converged", &Solution::converged)
        .def_readonly("branch", &Solution::branch)
        .def_readonly("tried", &Solution::tried);
    py::class_<Operator>(m, "CondensedOperator")
        .def(py::init(&make_operator), py::arg("W"), py::arg("dim"), py::arg("tied") = 0,
             py::arg("algebra") = py::none())
        .def_property_readonly("dim", &Operator::dim)
        .def_property_readonly("nodes", &Operator::nodes)
        .def_property_readonly("tied", &Operator::tied)
        .def("prepare", &Operator::prepare, py::call_guard<py::gil_scoped_release>())
        .def(
            "solve",
            [](const Operator &op, const Array &mu, const std::optional<Array> &p, const Array &q,
               const std::vector<Array> &starts, double tol, double slip_tol,
               const std::optional<Array> &stiffness,
               const std::optional<Array> &tangential_stiffness,
               const std::optional<Array> &tied_stiffness, double external, double local_tol,
               double max_seconds, int max_iterations, int newton_iterations, bool fallbacks,
               const std::vector<std::string> &without,
               const std::optional<std::function<void(double, const std::array<int, 3> &)>>
                   &monitor) {
                const Scales scales{optional(stiffness), optional(tangential_stiffness),
                                    optional(tied_stiffness), external};
                return solve_any(op, mu, p, q, starts,
                                 {tol, slip_tol, local_tol, max_seconds, max_iterations,
                                  newton_iterations, fallbacks, without, scales, heed_signals(),
                                  monitor.value_or(nullptr)});
            },
            py::arg("mu"), py::arg("p"), py::arg("q"), py::arg("starts"), py::arg("tol"),
            py::arg("slip_tol"), py::arg("stiffness") = py::none(),
            py::arg("tangential_stiffness") = py::none(), py::arg("tied_stiffness") = py::none(),
            py::arg("external") = 0.0,
            py::arg("local_tol") = std::numeric_limits<double>::infinity(),
            py::arg("max_seconds") = std::numeric_limits<double>::infinity(),
            py::arg("max_iterations") = 200'000, py::arg("newton_iterations") = 60,
            py::arg("fallbacks") = true, py::arg("without") = std::vector<std::string>{},
            py::arg("monitor") = py::none());
}
