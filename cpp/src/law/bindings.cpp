// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The law on NumPy arrays: its functions by name.
#include "py_law.h"

namespace {
template <int T> void bind_law(py::module_ &m, const char *name) {
    using Law = PyLaw<T>;
    using Call = typename Law::Call;
    const auto r = py::arg("r").noconvert(), tau = py::arg("tau").noconvert(),
               gap = py::arg("gap").noconvert(), slip = py::arg("slip").noconvert(),
               rho = py::arg("rho").noconvert(), rho_n = py::arg("rho_n").noconvert(),
               rho_t = py::arg("rho_t").noconvert(), branch = py::arg("branch").noconvert();

    py::class_<Law> law(m, name);
    law.def_property_readonly("kind", [](const Law &self) {
        return std::visit(
            [](const auto &source) { return std::decay_t<decltype(source)>::Law::kind; }, self.any);
    });
    law.def_property_readonly("dim", [](const Law &) { return Law::D; });
    law.def_readonly("nodes", &Law::nodes, "Number of nodes it has coefficients for, or None.");

    law.def(
        "load_function",
        [](const Law &self, const Array &r) { return Call(self, "r", r).number(LoadFunction{}); },
        r, "f = |M^-1 r_t| - r_n, shape (n,)  [dSFMH07, Eq. (1)]");
    law.def(
        "project",
        [](const Law &self, const Array &tau) {
            return Call(self, "tau", tau).reaction(EuclideanProjection{});
        },
        tau, "Euclidean projection on the friction cone: (r, branch)  [dSFMH07, Section 2]");
    law.def(
        "bipotential_map",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho) {
            return Call(self, "r", r).gap(gap).slip(slip).rho(rho).reaction(BipotentialMap{});
        },
        r, gap, slip, rho, "Predictor and corrector of [dSFMH07, Section 2]: (r, branch)");
    law.def(
        "scaled_map",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho) {
            return Call(self, "r", r).gap(gap).slip(slip).rho(rho).reaction(ScaledMap{});
        },
        r, gap, slip, rho, "The same in scaled variables, in closed form: (r, branch)");
    law.def(
        "return_map",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho_n,
           const Array &rho_t) {
            return Call(self, "r", r).gap(gap).slip(slip).rho(rho_n, rho_t).reaction(ReturnMap{});
        },
        r, gap, slip, rho_n, rho_t, "Projection in the metric of the slip rule: (r, branch)");

    law.def(
        "bipotential_jacobian",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho) {
            return Call(self, "r", r)
                .gap(gap)
                .slip(slip)
                .rho(rho)
                .linearisation(BipotentialJacobian{});
        },
        r, gap, slip, rho,
        "bipotential_map and its derivatives: (r, branch, by r, by (slip, gap))");
    law.def(
        "scaled_jacobian",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho) {
            return Call(self, "r", r).gap(gap).slip(slip).rho(rho).linearisation(ScaledJacobian{});
        },
        r, gap, slip, rho, "scaled_map and its derivatives: (r, branch, by r, by (slip, gap))");
    law.def(
        "return_jacobian",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip, const Array &rho_n,
           const Array &rho_t) {
            return Call(self, "r", r)
                .gap(gap)
                .slip(slip)
                .rho(rho_n, rho_t)
                .linearisation(ReturnJacobian{});
        },
        r, gap, slip, rho_n, rho_t,
        "return_map and its derivatives: (r, branch, by r, by (slip, gap))");

    law.def(
        "bipotential_gap",
        [](const Law &self, const Array &r, const Array &gap, const Array &slip) {
            return Call(self, "r", r).gap(gap).slip(slip).number(BipotentialGap{});
        },
        r, gap, slip, "Gap of the bi-potential for r in the cone and gap >= 0, shape (n,)");
    law.def(
        "slip_defect",
        [](const Law &self, const Array &r, const Array &slip, const Branches &branch) {
            return Call(self, "r", r).slip(slip).branch(branch).tangential(SlipDefect{});
        },
        r, slip, branch,
        "Part of the slip increment that the slip rule does not explain, (n, dim - 1)");
}
} // namespace

void bind_law(py::module_ &m) {
    bind_law<1>(m, "Law2D");
    bind_law<2>(m, "Law3D");
    m.def(
        "make_law",
        [](const Array &mu, const std::optional<Array> &p, int dim,
           const std::optional<Array> &axes) -> py::object {
            if (dim == 2)
                return py::cast(make_py_law<1>(mu, p, axes));
            if (dim == 3)
                return py::cast(make_py_law<2>(mu, p, axes));
            throw py::value_error("dim must be 2 or 3, not " + std::to_string(dim));
        },
        py::arg("mu"), py::arg("p"), py::arg("dim"), py::arg("axes") = py::none(),
        "The simplest law with coefficients mu and p of shape (dim-1,) or (n, dim-1). p None: "
        "associated. axes: principal direction x (cos, sin) of each node, shape (n, 2).");
}
