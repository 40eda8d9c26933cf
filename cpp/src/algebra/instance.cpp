// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The linear algebra of the condensed solver, compiled for what every processor can run.
#include <dolfinx_contact/algebra/eigen.h>

namespace dolfinx_contact::condensed {
template const LinearAlgebra &linear_algebra<>();
} // namespace dolfinx_contact::condensed
