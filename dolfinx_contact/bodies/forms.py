# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The user's forms: the derivative of F, whether it is linear, and a number that changes with what stands in them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import fem

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx_contact.contact.displacements import Displacements


def derivative_of(F: Any, u: fem.Function, J: Any, moving: bool = False):
    """The bilinear form of the tangent, and whether F is linear in u.

    Args:
        F: Residual form.
        u: Displacement.
        J: Derivative of F, or None.
        moving: Whether coefficients of F depend on ``u`` in a way that UFL does not know.
    """
    if not isinstance(F, ufl.Form) or len(F.arguments()) != 1:
        raise ValueError(
            f"F must be a residual form with one test function, as in DOLFINx's NonlinearProblem; got "
            f"{type(F).__name__}"
            + (f" of rank {len(F.arguments())}." if isinstance(F, ufl.Form) else ".")
        )
    if F.arguments()[0].ufl_function_space() != u.ufl_function_space():
        raise ValueError("the test function of F lives on another space than u.")
    if moving:
        if not isinstance(J, ufl.Form) or len(J.arguments()) != 2:
            raise ValueError(
                "with before_residual UFL cannot find the derivative of F: give J, a form with a test and a trial "
                "function."
            )
        return ufl.algorithms.expand_derivatives(J), False
    derivative = ufl.algorithms.expand_derivatives(
        ufl.derivative(F, u, ufl.TrialFunction(u.function_space))
    )
    if derivative.empty():
        raise ValueError(
            "F does not depend on u: write it as residual, internal minus external work. If its coefficients do, "
            "give before_residual and J."
        )
    linear = not depends_on(derivative, u)
    given = None if J is None else ufl.algorithms.expand_derivatives(J)
    if given is not None and not (linear and depends_on(given, u)):
        derivative = given
    return derivative, linear


def check_meshes(form: ufl.Form, u: fem.Function, entity_maps: Any) -> None:
    """Raise a ``ValueError`` if a form has integrals or Functions on another mesh, and nothing says how they lie in each other.

    Args:
        form: Residual form.
        u: Displacement.
        entity_maps: What the user gave.
    """
    domains = [integral.ufl_domain() for integral in form.integrals()]
    domains += [c.ufl_function_space().ufl_domain() for c in form.coefficients()]
    if entity_maps is None and any(
        domain != u.ufl_function_space().ufl_domain() for domain in domains
    ):
        raise ValueError(
            "F has integrals or Functions on another mesh than u: give the entity_maps that fem.form needs for it, "
            "ContactProblem(..., entity_maps=...), with DOLFINx 0.9 or newer."
        )


def depends_on(form: ufl.Form, u: fem.Function) -> bool:
    """Whether ``u`` is among the coefficients of a form."""
    return any(c is u for c in form.coefficients())


def digest_of(parameters: Iterable[Any], *more: Any) -> bytes:
    """A number that changes with the values of constants and coefficients, and with more bytes or arrays."""
    digest = hashlib.blake2b()
    for part in more:
        digest.update(part)
    for parameter in parameters:
        values = parameter.x.array if hasattr(parameter, "x") else parameter.value
        digest.update(np.ascontiguousarray(values))
    return digest.digest()


def values_of(parameters: Iterable[Any]) -> list[np.ndarray]:
    """Copies of the values of constants and coefficients."""
    return [np.array(each.x.array if hasattr(each, "x") else each.value) for each in parameters]


def same_values(parameters: Iterable[Any], before: list[np.ndarray] | None) -> bool:
    """Whether constants and coefficients have the values that ``values_of`` has returned, on this rank; None is no."""
    if before is None:
        return False
    now = (each.x.array if hasattr(each, "x") else each.value for each in parameters)
    return all(np.array_equal(here, there) for here, there in zip(now, before))


def times_volume(of: Displacements, modes: np.ndarray) -> np.ndarray:
    """Integrals of displacements times each shape function over the body's volume, ``shape=(owned dofs, m)``.  Collective.

    Args:
        of: ``Displacements``.
        modes: Values of owned degrees of freedom, of the same shape.
    """
    z, integral = fem.Function(of.V), fem.Function(of.V)
    form = fem.form(ufl.inner(z, ufl.TestFunction(of.V)) * ufl.dx)
    columns, size = [], of.count * of.dim
    for mode in modes.T:
        z.x.array[:size] = of.rows(mode).ravel()
        z.x.scatter_forward()
        compat.assemble_into(integral.x, form)
        columns.append(integral.x.array[:size].reshape(of.count, of.dim).copy())
    return of.vectors(np.stack(columns, axis=-1))
