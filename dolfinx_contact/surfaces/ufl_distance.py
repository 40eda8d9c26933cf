# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Values and gradient of a UFL expression of position, as compiled functions of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from ufl.algorithms.analysis import extract_type
from ufl.core.expr import Expr

from dolfinx_contact import compat


def is_ufl(given: object) -> bool:
    """Whether an object is a UFL expression."""
    return isinstance(given, Expr)


def by_ufl(expression: Any, gdim: int) -> tuple[_Evaluated, _Evaluated]:
    """Return functions for values and gradient of a scalar UFL expression at arbitrary positions.

    The expression is evaluated on an auxiliary mesh with one cell for each position, so that
    positions may be outside the user's mesh.  Constants have their values at the time of the call.

    Args:
        expression: Scalar expression of ``SpatialCoordinate``, numbers and ``Constant``.
        gdim: Dimension of the positions.

    Returns:
        Two functions of positions, ``shape=(gdim, n)``: values, ``shape=(n,)``, and derivatives,
        ``shape=(gdim, n)``.

    Raises:
        ValueError: the expression is not scalar, or contains other terms.
    """
    allowed = (
        ufl.classes.SpatialCoordinate,
        ufl.classes.Constant,
        ufl.classes.ConstantValue,
        ufl.classes.MultiIndex,
    )
    others = [
        t for t in extract_type(expression, ufl.classes.Terminal) if not isinstance(t, allowed)
    ]
    coordinates = list(extract_type(expression, ufl.classes.SpatialCoordinate))
    if expression.ufl_shape != () or others or [x.ufl_shape for x in coordinates] != [(gdim,)]:
        raise ValueError(
            f"distance in UFL must be a scalar expression of the SpatialCoordinate of a mesh in {gdim} dimensions, of numbers"
            f" and Constants; got shape {expression.ufl_shape}, of {[*map(str, others or coordinates)]}. Give a Python"
            " function of positions for anything else."
        )
    x = coordinates[0]
    return _Evaluated(expression, x, False), _Evaluated(expression, x, True)


class _Evaluated:
    """Function that evaluates a UFL expression, or its gradient, at an array of positions.

    It is compiled at the first call, and again if a later call has more positions.
    """

    def __init__(self, expression: Any, x: np.ndarray, derived: bool):
        self._given, self._x, self._derived = expression, x, derived
        self._constants = list(extract_type(expression, ufl.classes.Constant))
        self._capacity = 0

    def __call__(self, y: np.ndarray) -> np.ndarray:
        gdim, n = y.shape
        if n > self._capacity:
            self._compile(gdim, n)
        self._position.x.array.reshape(-1, gdim)[self._nodes[:n]] = y.T
        for own, given in zip(self._own_constants, self._constants):
            own.value[...] = given.value
        found = compat.cell_values(self._compiled, self._mesh, np.arange(n, dtype=np.int32))
        return found.T.copy() if self._derived else found.ravel()

    def _compile(self, gdim: int, n: int) -> None:
        self._mesh, self._capacity = compat.intervals(n), n
        V = compat.functionspace(self._mesh, ("DG", 0, (gdim,)))
        self._position, self._nodes = fem.Function(V), compat.cell_nodes(V)[:, 0]
        self._own_constants = [
            fem.Constant(self._mesh, np.array(c.value, float)) for c in self._constants
        ]
        at = ufl.variable(self._position)
        moved = ufl.replace(
            self._given, {self._x: at, **dict(zip(self._constants, self._own_constants))}
        )
        moved = ufl.diff(moved, at) if self._derived else moved
        self._compiled = fem.Expression(moved, np.array([[0.5]]))
