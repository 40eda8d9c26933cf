# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Whether an assembled stiffness is that of a material: moduli of the wrong sign are found before a step."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.support.checks import place
from dolfinx_contact.support.collective import from_first, raised_together

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.displacements import Displacements


def check_diagonal(diagonal: np.ndarray, displacements: Displacements) -> None:
    """Raise a ``ValueError`` if an entry is not finite, or one of a displacement is not positive."""
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
    """Raise a ``ValueError`` if the body gains energy by growing, as with Poisson's ratio above 0.5.  Collective.

    Args:
        body: ElasticBody, its stiffness assembled, nothing held yet.
    """
    of = body.displacements
    if of.mixed:
        return  # pressures do the work
    growth = of.x[: of.count, : of.dim].ravel() / body.extent
    energy, scale = body.total(
        [growth @ body.multiply(growth), growth @ (body.diagonal() * growth)]
    )
    if energy < -1e-10 * scale:
        raise ValueError(
            f"a body that grows evenly gains energy ({energy:g}): check the moduli, Poisson's ratio must be "
            "below 0.5."
        )


def agree_on_values(parameters: Iterable[Any], comm: MPI.Comm) -> None:
    """Raise a ``ValueError`` if a constant of forms or conditions differs between ranks: different problems.

    Of Functions the values of the ranks that own them count: ghosts are brought up to date.  Collective.
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
    """Warn of PETSc options that were not asked for; those of levels are only where there are levels."""
    unread = [name for name in options if not name.startswith(("mg_levels_", "mg_coarse_"))]
    if unread:
        warnings.warn(
            f"petsc_options {unread} were not read by PETSc: they are misspelt, or do not belong to this solver and "
            "preconditioner. `-help` lists those there are.",
            stacklevel=2,
        )


def check_finite(arrays: dict, comm: MPI.Comm) -> None:
    """Raise a ``ValueError`` on all ranks if one of the arrays, by their names, is not finite.  Collective."""
    with raised_together(comm):
        for name, values in arrays.items():
            if not np.isfinite(values).all():
                raise ValueError(f"the {name} contain NaN or infinity: nothing was solved.")
