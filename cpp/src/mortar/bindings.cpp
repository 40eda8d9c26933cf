// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The geometry of two meshes that meet, on NumPy arrays.
#include <dolfinx_contact/mortar/clip.h>
#include <dolfinx_contact/mortar/integrate.h>

#include <algorithm>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

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

// One side of pairs of pieces: corners in the plane and on the reference facet, shape functions.
struct PairedSide {
    const Corners &corners, &local, &coefficients;
    py::ssize_t pairs, k, dim;
    dolfinx_contact::FacetShapes shapes;

    PairedSide(const Corners &corners_, const Corners &local_, const Corners &coefficients_,
               int degree)
        : corners(corners_), local(local_), coefficients(coefficients_),
          pairs(checked(corners_, local_, coefficients_, degree)), k(corners_.shape(1)),
          dim(corners_.shape(2)), shapes(int(k), degree, coefficients_.data()) {
        if (coefficients.shape(0) != shapes.count() || coefficients.shape(1) != shapes.count())
            throw py::value_error("coefficients must have a row and column for each monomial");
    }
    dolfinx_contact::FacetPiece piece(py::ssize_t i) const {
        const py::ssize_t first = i * k * dim;
        return {polygon_of(corners.data() + first, k, dim),
                polygon_of(local.data() + first, k, dim)};
    }

  private:
    static py::ssize_t checked(const Corners &corners, const Corners &local,
                               const Corners &coefficients, int degree) {
        if (corners.ndim() != 3 || local.ndim() != 3 || coefficients.ndim() != 2)
            throw py::value_error(
                "corners and local must have shape (n, k, dim), coefficients two dimensions");
        const py::ssize_t k = corners.shape(1), dim = corners.shape(2);
        for (int axis = 0; axis < 3; ++axis)
            if (corners.shape(axis) != local.shape(axis))
                throw py::value_error("corners and local must have the same shape");
        if (!(dim == 1 && k == 2) && !(dim == 2 && (k == 3 || k == 4)))
            throw py::value_error("pieces must be intervals, triangles or quadrilaterals");
        if (degree != 1 && degree != 2)
            throw py::value_error("degree must be 1 or 2");
        return corners.shape(0);
    }
};

// Integrals of products of shape functions over the common parts of pairs of pieces.
auto common_integrals(const Corners &one, const Corners &one_local, const Corners &one_shapes,
                      int one_degree, const Corners &other, const Corners &other_local,
                      const Corners &other_shapes, int other_degree, const Corners &at,
                      const Corners &weights, const Corners &density) {
    const PairedSide here(one, one_local, one_shapes, one_degree),
        there(other, other_local, other_shapes, other_degree);
    if (here.pairs != there.pairs || here.dim != there.dim || at.ndim() != 1 ||
        weights.ndim() != 1 || at.size() != weights.size())
        throw py::value_error("one and other must have as many pieces, at and weights points");
    const py::ssize_t n = here.pairs, k = here.shapes.count(), m = there.shapes.count();
    if (density.size() > 0 && density.size() != n * k)
        throw py::value_error("density must have shape (n, k), or no entries");
    py::array_t<double> D({n, k}), M({n, k, k}), C({n, k, m});
    for (auto *array : {&D, &M, &C})
        std::fill_n(array->mutable_data(), array->size(), 0.0);
    const dolfinx_contact::LineRule rule{int(at.size()), at.data(), weights.data()};
    for (py::ssize_t i = 0; i < n; ++i)
        dolfinx_contact::add_common_integrals(
            here.piece(i), here.shapes, there.piece(i), there.shapes, rule,
            density.size() > 0 ? density.data() + k * i : nullptr, D.mutable_data() + k * i,
            M.mutable_data() + k * k * i, C.mutable_data() + k * m * i);
    return py::make_tuple(D, M, C);
}
} // namespace

void bind_mortar(py::module_ &m) {
    m.def("clip", clip_all, py::arg("polygons"), py::arg("by"),
          "The common parts of pairs of convex polygons, corners in order, shape (n, k, 2) with k "
          "at most 4: "
          "(corners of shape (n, k + m, 2), how many of them count of shape (n,)), zero where "
          "there is no area.");
    m.def("common_integrals", common_integrals, py::arg("one"), py::arg("one_local"),
          py::arg("one_shapes"), py::arg("one_degree"), py::arg("other"), py::arg("other_local"),
          py::arg("other_shapes"), py::arg("other_degree"), py::arg("at"), py::arg("weights"),
          py::arg("density"),
          "Integrals over the common parts of n pairs of pieces: of shape functions N of the one "
          "side, shape (n, k), of products of them, (n, k, k), and with those of the other side, "
          "(n, k, m). Pieces are corners in the plane or on a line, shape (n, c, dim), and where "
          "these are on the reference facet; shape functions are monomials times coefficients, "
          "shape (k, k); at and weights are a rule on the unit interval; density is that of the "
          "measure, shape (n, k), at the nodes of the one side's facets, or empty.");
}
