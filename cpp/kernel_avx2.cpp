// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The condensed solver alone, once more, compiled for processors with AVX2 and FMA. A module of its
// own: in one with the other, the linker would merge inline functions of both.
#include <pybind11/pybind11.h>

void bind_condensed(pybind11::module_ &m); // bindings_condensed.cpp

PYBIND11_MODULE(_kernel_avx2, m) {
    m.doc() = "The condensed solver of _kernel for processors with AVX2 and FMA.";
    bind_condensed(m);
}
