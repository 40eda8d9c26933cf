# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The user's forms: the bilinear part of F, and a number that changes with what stands in them."""

from __future__ import annotations

import hashlib

import numpy as np
import ufl


def linear_part(F, u, J):
    """The bilinear form of F, after a check that F is linear in u."""
    if not isinstance(F, ufl.Form) or len(F.arguments()) != 1:
        raise ValueError(
            f"F must be a residual form with one test function, as in DOLFINx's NonlinearProblem; got "
            f"{type(F).__name__}"
            + (f" of rank {len(F.arguments())}." if isinstance(F, ufl.Form) else ".")
        )
    if F.arguments()[0].ufl_function_space() != u.ufl_function_space():
        raise ValueError("the test function of F lives on another space than u.")
    derivative = ufl.algorithms.expand_derivatives(
        ufl.derivative(F, u, ufl.TrialFunction(u.function_space))
    )
    if derivative.empty():
        raise ValueError(
            "F does not depend on u: write it as residual, internal minus external work."
        )
    if J is not None:
        derivative, given = ufl.algorithms.expand_derivatives(J), derivative
        if any(c is u for c in given.coefficients()):
            derivative = given
    if any(c is u for c in derivative.coefficients()):
        raise NotImplementedError("F is not linear in u: nonlinear bodies are not supported yet.")
    return derivative


def digest_of(parameters) -> bytes:
    """A number that changes with the values of constants and coefficients."""
    digest = hashlib.blake2b()
    for parameter in parameters:
        values = parameter.x.array if hasattr(parameter, "x") else parameter.value
        digest.update(np.ascontiguousarray(values))
    return digest.digest()
