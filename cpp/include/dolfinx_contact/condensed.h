// Copyright (c) 2025 The dolfinx_contact authors
// SPDX-License-Identifier: MIT
/// @file condensed.h
/// The solver of the condensed contact problem, w = q + W r, on plain arrays: all of it, to
/// compile.
#pragma once

#include "algebra/eigen.h"
#include "condensed/search.h"
