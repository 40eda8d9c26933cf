// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
//
// The condensed solver for TANGENTS tangential directions. Its compilation takes a minute: CMake
// compiles this file once for each number of directions, at the same time.
#include <dolfinx_contact/condensed/search.h>

namespace dolfinx_contact::condensed {
template Solution solve<TANGENTS>(const Operator &, const AnyLaw<TANGENTS> &, const VectorXd &,
                                  const std::vector<VectorXd> &, const Options &);
} // namespace dolfinx_contact::condensed
