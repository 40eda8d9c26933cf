// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The condensed solver alone, once more, compiled for processors with more instructions. A module
// of its own for each set of them: in one with another, the linker would merge inline functions of
// both.
#include <pybind11/pybind11.h>

void bind_condensed(pybind11::module_ &m); // bindings_condensed.cpp

PYBIND11_MODULE(MODULE, m) {
    m.doc() = "The condensed solver of _kernel for processors with the instructions in its name.";
    bind_condensed(m);
}
