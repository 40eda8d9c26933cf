# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of the user's forms, parameters and boundary conditions, and the derivative of F."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import fem

from dolfinx_contact.support.checks import place
from dolfinx_contact.support.collective import from_first, raised_together

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.displacements import Displacements


def derivative_of(F: Any, u: fem.Function, J: Any, moving: bool = False):
    """Return the bilinear form of the tangent, and whether F is linear in u.

    Args:
        F: Residual form.
        u: Displacement.
        J: Derivative of F, or None.
        moving: Whether coefficients of F depend on ``u`` in a way unknown to UFL.

    Raises:
        ValueError: F is not a residual form on the space of u, does not depend on u, or needs a J.
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
    """Raise a ``ValueError`` if a form involves another mesh than ``u``, without entity maps.

    Args:
        form: Residual form.
        u: Displacement.
        entity_maps: Entity maps given by the user, or None.
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
    """Hash of the values of constants and coefficients, and of additional bytes or arrays."""
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
    """Whether constants and coefficients have given values on this rank; False if those are None.

    Args:
        parameters: Constants and coefficients.
        before: Values, as ``values_of`` returned them, or None.
    """
    if before is None:
        return False
    now = (each.x.array if hasattr(each, "x") else each.value for each in parameters)
    return all(np.array_equal(here, there) for here, there in zip(now, before))


def check_diagonal(diagonal: np.ndarray, displacements: Displacements) -> None:
    """Raise a ``ValueError`` if a diagonal entry of the stiffness is not finite or not positive.

    Entries of unknowns other than displacements need not be positive.
    """
    if not np.isfinite(diagonal).all():
        raise ValueError(
            "the stiffness contains NaN or infinity: check the material parameters in F (nu = 0.5 has no stiffness)."
        )
    diagonal = displacements.rows(diagonal)
    if not (diagonal > 0.0).all():
        node = int(np.argmin(diagonal.min(axis=1)))
        raise ValueError(
            f"the stiffness of the node at {place(displacements.x, node)} is {diagonal[node].min():g}, which must be positive: check the sign "
            "of F (internal minus external work) and the moduli (0 < E, nu < 0.5)."
        )


def check_dilation(body: ElasticBody) -> None:
    """Raise a ``ValueError`` if uniform expansion releases energy: Poisson's ratio above 0.5.
    Collective.

    Args:
        body: ElasticBody with its stiffness assembled, without Dirichlet conditions.
    """
    displacements = body.displacements
    if displacements.mixed:
        return  # pressures do the work
    growth = displacements.x[: displacements.count, : displacements.dim].ravel() / body.extent
    energy, scale = body.total(
        [growth @ body.multiply(growth), growth @ (body.diagonal() * growth)]
    )
    if energy < -1e-10 * scale:
        raise ValueError(
            f"a body that grows evenly gains energy ({energy:g}): check the moduli, Poisson's ratio must be "
            "below 0.5."
        )


def check_same_values(parameters: Iterable[Any], comm: MPI.Comm) -> None:
    """Raise a ``ValueError`` on all ranks if a constant differs between ranks.  Collective.

    Ghost values of Functions are updated.

    Args:
        parameters: Constants and coefficients of forms and boundary conditions.
        comm: MPI communicator.
    """
    for function in parameters:
        if hasattr(function, "x"):
            function.x.scatter_forward()
    mine = [np.array(each.value) for each in parameters if not hasattr(each, "x")]
    first = from_first(comm, mine)
    with raised_together(comm):
        for here, there in zip(mine, first):
            if not np.array_equal(here, there, equal_nan=True):
                raise ValueError(
                    f"a constant in F or a boundary condition differs between ranks: here {here.tolist()}, on rank 0 "
                    f"{there.tolist()}. Give the same on all."
                )


def warn_of_unread(options: list[str]) -> None:
    """Warn of PETSc options that were not read, except options of multigrid levels."""
    unread = [name for name in options if not name.startswith(("mg_levels_", "mg_coarse_"))]
    if unread:
        warnings.warn(
            f"petsc_options {unread} were not read by PETSc: they are misspelt, or do not belong to this solver and "
            "preconditioner. `-help` lists those there are.",
            stacklevel=2,
        )


def check_finite(arrays: dict, comm: MPI.Comm) -> None:
    """Raise a ``ValueError`` on all ranks if an array contains NaN or infinity.  Collective.

    Args:
        arrays: Arrays by their names in the message.
        comm: MPI communicator.
    """
    with raised_together(comm):
        for name, values in arrays.items():
            if not np.isfinite(values).all():
                raise ValueError(f"the {name} contain NaN or infinity: nothing was solved.")
