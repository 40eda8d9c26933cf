// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The linear algebra of the condensed solver once more, compiled for processors with more
// instructions. A module of its own for each set of them: in one with another, the linker would
// merge inline functions of both.
#include <dolfinx_contact/algebra/eigen.h>
#include <pybind11/pybind11.h>

PYBIND11_MODULE(MODULE, m) {
    m.doc() = "Linear algebra of the condensed solver for processors with the instructions in its "
              "name; the last argument of CondensedOperator.";
    m.attr("linear_algebra") = pybind11::capsule(&dolfinx_contact::condensed::linear_algebra(),
                                                 "dolfinx_contact.LinearAlgebra");
}
