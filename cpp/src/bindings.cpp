// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The kernel as a Python module.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

void bind_law(pybind11::module_ &m);       // law/bindings.cpp
void bind_condensed(pybind11::module_ &m); // condensed/bindings.cpp
void bind_mortar(pybind11::module_ &m);    // mortar/bindings.cpp
void bind_sparse(pybind11::module_ &m);    // sparse/bindings.cpp

PYBIND11_MODULE(_kernel, m) {
    m.doc() =
        "Kernel of dolfinx_contact: friction law, cone and maps on NumPy arrays.\n\n"
        "Local frame (t1, t2, n), or (t, n) in two dimensions. r, tau: (n, dim); gap, rho:\n"
        "(n,); slip: (n, dim - 1); branch: uint8, 0 open, 1 stick, 2 slip. All float64 of any\n"
        "strides, read in place.";
    bind_law(m);
    bind_condensed(m);
    bind_mortar(m);
    bind_sparse(m);
    m.def(
        "stubs", [] { return STUBS; }, "SHA-256 of the type stubs that it was compiled with.");
    m.def(
        "instruction_sets",
        [] {
            std::vector<std::string> sets;
#if defined(__x86_64__)
            if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
                sets.emplace_back("avx512");
            if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
                sets.emplace_back("avx2");
#endif
            return sets;
        },
        "What this processor can run beyond what every one can, the widest first: _algebra_avx512, "
        "_algebra_avx2.");
}
