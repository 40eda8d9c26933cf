// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The geometry of two meshes that meet, on NumPy arrays.
#include <dolfinx_contact/mortar/clip.h>
#include <dolfinx_contact/mortar/rows.h>

#include <algorithm>
#include <cstdint>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <vector>

namespace py = pybind11;

namespace {
using dolfinx_contact::Point;
using dolfinx_contact::Polygon;
using Corners = py::array_t<double, py::array::c_style | py::array::forcecast>;

constexpr int MOST = 4; // corners of a facet

Polygon<MOST> polygon_of(const double *x, py::ssize_t count, py::ssize_t dim = 2) {
    Polygon<MOST> polygon;
    for (py::ssize_t k = 0; k < count; ++k)
        polygon.add({x[dim * k], dim == 2 ? x[dim * k + 1] : 0.0});
    return polygon;
}

// Corners of the common parts of pairs of polygons, and how many there are.
auto clip_all(const Corners &polygons, const Corners &by) {
    if (polygons.ndim() != 3 || by.ndim() != 3 || polygons.shape(2) != 2 || by.shape(2) != 2 ||
        polygons.shape(0) != by.shape(0) || polygons.shape(1) > MOST || by.shape(1) > MOST)
        throw py::value_error("polygons and by must have shape (n, k, 2), k at most 4");
    const py::ssize_t n = polygons.shape(0), k = polygons.shape(1), m = by.shape(1), most = k + m;
    py::array_t<double> corners({n, most, py::ssize_t(2)});
    py::array_t<int> counts(n);
    std::fill_n(corners.mutable_data(), corners.size(), 0.0);
    for (py::ssize_t i = 0; i < n; ++i) {
        const auto common = dolfinx_contact::clip(polygon_of(polygons.data() + 2 * k * i, k),
                                                  polygon_of(by.data() + 2 * m * i, m));
        double *out = corners.mutable_data() + 2 * most * i;
        for (int j = 0; j < common.count; ++j)
            out[2 * j] = common[j].x, out[2 * j + 1] = common[j].y;
        counts.mutable_data()[i] = common.count;
    }
    return py::make_tuple(corners, counts);
}

using Numbers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

// Facets of one shape of one side, as Python has them.
struct SideArrays {
    Corners x, outwards, local, coefficients, density;
    Numbers numbers, cuts;
    int degree;

    explicit SideArrays(const py::tuple &side)
        : x(side[0].cast<Corners>()), outwards(side[1].cast<Corners>()),
          local(side[2].cast<Corners>()), coefficients(side[3].cast<Corners>()),
          density(side[4].cast<Corners>()), numbers(side[5].cast<Numbers>()),
          cuts(side[6].cast<Numbers>()), degree(side[7].cast<int>()) {}

    dolfinx_contact::MortarSide side() const {
        if (x.ndim() != 3 || local.ndim() != 2 || cuts.ndim() != 2)
            throw py::value_error("x must have shape (m, k, dim), local and cuts two dimensions");
        const py::ssize_t m = x.shape(0), k = x.shape(1), dim = x.shape(2), c = cuts.shape(1);
        if (!(dim == 2 && c == 2) && !(dim == 3 && (c == 3 || c == 4)))
            throw py::value_error("pieces must be intervals, triangles or quadrilaterals");
        if (degree != 1 && degree != 2)
            throw py::value_error("degree must be 1 or 2");
        const dolfinx_contact::FacetShapes shapes(int(c), degree, coefficients.data());
        if (shapes.count() != k || coefficients.size() != k * k || outwards.size() != m * dim ||
            local.size() != k * (dim - 1) || numbers.size() != m * k ||
            (density.size() > 0 && density.size() != m * k))
            throw py::value_error("arrays of a side must have the shapes that x and cuts say");
        for (py::ssize_t i = 0; i < cuts.size(); ++i)
            if (cuts.data()[i] < 0 || cuts.data()[i] >= k)
                throw py::value_error("cuts must be numbers of the k nodes of a facet");
        return {int(dim),
                std::size_t(m),
                int(k),
                int(c),
                degree,
                std::size_t(cuts.shape(0)),
                x.data(),
                outwards.data(),
                numbers.data(),
                local.data(),
                cuts.data(),
                coefficients.data(),
                density.size() > 0 ? density.data() : nullptr};
    }
};

std::vector<SideArrays> arrays_of(const py::list &sides) {
    std::vector<SideArrays> found;
    for (const auto &side : sides)
        found.emplace_back(side.cast<py::tuple>());
    return found;
}

py::array_t<double> as_array(const std::vector<double> &values) {
    return py::array_t<double>(py::ssize_t(values.size()), values.data());
}

// Rows of the slave nodes, each column once, in order.
auto mortar_rows(const py::list &slaves, const py::list &masters, std::size_t count,
                 const py::list &rules) {
    const auto own = arrays_of(slaves), others = arrays_of(masters);
    std::vector<Corners> kept;
    std::vector<dolfinx_contact::LineRule> lines;
    for (const auto &rule : rules) {
        const auto pair = rule.cast<py::tuple>();
        const auto at = pair[0].cast<Corners>(), weights = pair[1].cast<Corners>();
        if (at.size() != weights.size())
            throw py::value_error("a rule must have as many weights as points");
        lines.push_back({int(at.size()), at.data(), weights.data()});
        kept.insert(kept.end(), {at, weights});
    }
    std::vector<dolfinx_contact::MortarSide> opposite;
    for (const auto &other : others)
        opposite.push_back(other.side());
    dolfinx_contact::MortarRows found(count, lines);
    for (const auto &side : own) {
        const auto slave = side.side();
        for (py::ssize_t i = 0; i < side.numbers.size(); ++i)
            if (side.numbers.data()[i] >= std::int64_t(count))
                throw py::value_error("rows of slave nodes must be below count");
        for (const auto &other : opposite)
            if (other.dim != slave.dim)
                throw py::value_error("both sides must have the same dimension");
        found.add(slave, opposite);
    }
    std::vector<double> values;
    std::vector<std::int32_t> columns, starts{0};
    for (auto &row : found.rows) {
        std::stable_sort(row.begin(), row.end(),
                         [](const auto &a, const auto &b) { return a.first < b.first; });
        for (std::size_t i = 0; i < row.size(); ++i) {
            if (i == 0 || row[i].first != row[i - 1].first)
                columns.push_back(std::int32_t(row[i].first)), values.push_back(0);
            values.back() += row[i].second;
        }
        starts.push_back(std::int32_t(columns.size()));
    }
    const auto numbers = [](const std::vector<std::int32_t> &of) {
        return py::array_t<std::int32_t>(py::ssize_t(of.size()), of.data());
    };
    return py::make_tuple(as_array(found.area), as_array(found.whole), as_array(values),
                          numbers(columns), numbers(starts));
}
} // namespace

void bind_mortar(py::module_ &m) {
    m.def("clip", clip_all, py::arg("polygons"), py::arg("by"),
          "The common parts of pairs of convex polygons, corners in order, shape (n, k, 2) with k "
          "at most 4: "
          "(corners of shape (n, k + m, 2), how many of them count of shape (n,)), zero where "
          "there is no area.");
    m.def(
        "mortar_rows", mortar_rows, py::arg("slaves"), py::arg("masters"), py::arg("count"),
        py::arg("rules"),
        "Rows of a dual mortar method: (int N_a over the covered part, shape (count,), over all of "
        "it, and int psi_a N_b, values, columns and starts of rows). Sides are lists of facets of "
        "one "
        "shape each, (x of shape (m, k, dim), outward normals (m, dim), nodes on the reference "
        "facet "
        "(k, dim - 1), coefficients of the shape functions (k, k), a row for each monomial, "
        "density of "
        "the measure (m, k) or empty, rows or columns of the nodes (m, k), negative is none, nodes "
        "at "
        "the corners of each straight piece (parts, c), degree); rules are (points, weights) on "
        "the "
        "unit interval, with ever more points for quadrilaterals that are no parallelograms.");
}
