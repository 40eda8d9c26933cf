# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Linear isotropic elasticity, once for all tests, studies and benchmarks."""

from __future__ import annotations

import ufl


def stress(u, E, nu):
    """Hooke's law as a UFL expression; plane strain in two dimensions."""
    strain = ufl.sym(ufl.grad(u))
    lame = E * nu / ((1 + nu) * (1 - 2 * nu))
    return lame * ufl.tr(strain) * ufl.Identity(len(u)) + E / (1 + nu) * strain


def elasticity(u, v, E, nu, dx=ufl.dx):
    """Internal virtual work of the displacement ``u`` along ``v``."""
    return ufl.inner(stress(u, E, nu), ufl.sym(ufl.grad(v))) * dx
