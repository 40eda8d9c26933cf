// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The geometry of two meshes that meet, on NumPy arrays.
#include <dolfinx_contact/mortar/clip.h>

#include <algorithm>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

namespace py = pybind11;

namespace {
using dolfinx_contact::Point;
using dolfinx_contact::Polygon;
using Corners = py::array_t<double, py::array::c_style | py::array::forcecast>;

constexpr int MOST = 4; // corners of a facet

Polygon<MOST> polygon_of(const double *xy, py::ssize_t count) {
    Polygon<MOST> polygon;
    for (py::ssize_t k = 0; k < count; ++k)
        polygon.add({xy[2 * k], xy[2 * k + 1]});
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
} // namespace

void bind_mortar(py::module_ &m) {
    m.def("clip", clip_all, py::arg("polygons"), py::arg("by"),
          "The common parts of pairs of convex polygons, corners in order, shape (n, k, 2) with k "
          "at most 4: "
          "(corners of shape (n, k + m, 2), how many of them count of shape (n,)), zero where "
          "there is no area.");
}
