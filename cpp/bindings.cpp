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

namespace py = pybind11;
using namespace dolfinx_contact;
using py::ssize_t;

namespace {
using Array = py::array_t<double>;
using Branches = py::array_t<std::uint8_t>;

std::string text(const std::vector<ssize_t> &shape) { return py::str(py::tuple(py::cast(shape))); }

std::vector<ssize_t> shape_of(const py::array &array) {
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
            Array value({n});
            Outputs out;
            out.value = written(value);
            run(out, f);
            return value;
        }

        template <class F> std::pair<Array, Branches> reaction(F f) const {
            Array value = vectors();
            Branches branch({n});
            Outputs out;
            out.value = written(value);
            out.branch = written(branch);
            run(out, f);
            return {value, branch};
        }

        template <class F> std::tuple<Array, Branches, Array, Array> linearisation(F f) const {
            Array value = vectors(), by_reaction = zeros<double>({n, D, D}),
                  by_motion = zeros<double>({n, D, D});
            Branches branch({n});
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
        "project_jacobian",
        [](const Law &self, const Array &tau) {
            const auto all = Call(self, "tau", tau).linearisation(ProjectionJacobian{});
            return std::make_tuple(std::get<0>(all), std::get<1>(all), std::get<2>(all));
        },
        tau, "project and its derivative: (r, branch, dr/dtau of shape (n, dim, dim))");
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
            return Call(self, "r", r).slip(slip).branch(branch).number(SlipDefect{});
        },
        r, slip, branch, "Part of the slip increment that the slip rule does not explain, (n,)");
}
} // namespace

void bind_condensed(py::module_ &m); // bindings_condensed.cpp

PYBIND11_MODULE(_kernel, m) {
    m.doc() =
        "Kernel of dolfinx_contact: friction law, cone and maps on NumPy arrays.\n\n"
        "Local frame (t1, t2, n), or (t, n) in two dimensions. r, tau: (n, dim); gap, rho:\n"
        "(n,); slip: (n, dim - 1); branch: uint8, 0 open, 1 stick, 2 slip. All float64 of any\n"
        "strides, read in place.";
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
    bind_condensed(m);
}
