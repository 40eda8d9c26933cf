# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid-body modes without strain energy, which only contact can prevent."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from scipy.linalg import block_diag

from dolfinx_contact import compat

if TYPE_CHECKING:
    from dolfinx_contact.contact.displacements import Displacements

# Components below this fraction of the largest one are left out of a motion's description.
NEGLIGIBLE_COMPONENT = 3e-3

# Distance of a rotation axis from the body's centre, over the body's size, beyond which the motion
# is described as a translation.
AXIS_DISTANCE = 3.0


class LoosePart(NamedTuple):
    """A connected part of a body, with its rigid-body modes without strain energy."""

    where: str  # name of the part in messages
    modes: np.ndarray  # (owned dofs, k)
    combination: np.ndarray  # coefficients of the modes in the basis of ``rigid_modes``
    middle: np.ndarray  # centre of rotations
    size: float  # length by which rotations are scaled


class LooseMotions:
    """All rigid-body modes of a body without strain energy.

    Args:
        parts: The parts of the body that have such modes, at least one.

    Attributes:
        modes: ``Z``, ``shape=(owned dofs, m)``, zero at fixed degrees of freedom; ``K Z = 0``.
    """

    def __init__(self, parts: list[LoosePart]):
        self._parts, self.modes = parts, np.concatenate([part.modes for part in parts], axis=1)
        self._combination = block_diag(*(part.combination for part in parts))

    def refusal(self, motions: np.ndarray | None = None) -> str:
        """Return an error message about unsupported rigid motions ``Z motions``.

        Args:
            motions: Coefficients, ``shape=(m, k)``; None means all modes.
        """
        motions = np.eye(self.modes.shape[1]) if motions is None else motions
        rows = self._simplest_basis(motions)
        message = "; ".join(self._description(row) for row in rows)
        return f"nothing holds {self._largest_part(rows[0])[0].where}: {len(rows)} rigid motion(s) are left free, {message}."

    def words(self, c: np.ndarray) -> str:
        """Return a description of the rigid motion ``Z c``."""
        return self._description(self._combination @ c)

    def _description(self, amounts: np.ndarray) -> str:
        part, amounts = self._largest_part(amounts)
        gdim = part.middle.size
        along, turning = amounts[:gdim], _rotation(amounts[gdim:]) / part.size
        place = "" if part.where == "the body" else f" of {part.where}"
        if np.linalg.norm(turning) * part.size < NEGLIGIBLE_COMPONENT * np.linalg.norm(along):
            return f"a translation along {_direction_text(along)}{place}"
        axis = turning / np.linalg.norm(turning)
        arm = np.cross(axis, np.append(along, np.zeros(3 - gdim))) / np.linalg.norm(turning)
        if np.linalg.norm(arm) > AXIS_DISTANCE * part.size:
            middle = ", ".join(f"{x:.4g}" for x in part.middle)
            return f"a translation along {_direction_text(along)} that turns a little about the middle ({middle}){place}"
        at = part.middle + arm[:gdim]
        at[np.abs(at) < NEGLIGIBLE_COMPONENT * part.size] = 0.0
        about = f"({', '.join(f'{x:.4g}' for x in at)}){place}"
        return f"a rotation about {'' if gdim == 2 else f'the axis {_direction_text(axis)} through '}{about}"

    def _simplest_basis(self, motions: np.ndarray) -> np.ndarray:
        """Return a basis of the same rigid motions with as many pure translations as possible.

        Each row contains coefficients of the translations and rotations of each part.

        Args:
            motions: Coefficients of the modes ``Z``, ``shape=(m, k)``.
        """
        gdim = self._parts[0].middle.size
        rows = (self._combination @ motions).T
        each = rows.shape[1] // len(self._parts)
        turning = np.arange(rows.shape[1]) % each >= gdim
        done = 0
        for column in (*np.flatnonzero(turning), *np.flatnonzero(~turning)):
            if done == len(rows):
                break
            largest = done + int(np.abs(rows[done:, column]).argmax())
            if abs(rows[largest, column]) < NEGLIGIBLE_COMPONENT * np.abs(rows).max():
                continue
            rows[[done, largest]] = rows[[largest, done]]
            rows[done] /= rows[done, column]
            others = np.arange(len(rows)) != done
            rows[others] -= np.outer(rows[others, column], rows[done])
            done += 1
        return rows

    def _largest_part(self, amounts: np.ndarray) -> tuple[LoosePart, np.ndarray]:
        """Return the part of the body with the largest motion, and its coefficients there."""
        shares = np.split(amounts, len(self._parts))
        k = int(np.argmax([np.linalg.norm(share) for share in shares]))
        return self._parts[k], shares[k]


def _rotation(amounts: np.ndarray) -> np.ndarray:
    """Rotation vector from the coefficients of the rotations in ``rigid_modes``, ``shape=(3,)``."""
    if amounts.size == 1:
        return np.array([0.0, 0.0, -amounts[0]])
    about_z, about_y, about_x = amounts
    return np.array([-about_x, about_y, -about_z])


def _direction_text(vector: np.ndarray) -> str:
    vector = vector / np.linalg.norm(vector)
    return f"({', '.join(f'{x:.3g}' for x in np.where(np.abs(vector) < NEGLIGIBLE_COMPONENT, 0.0, vector))})"


def times_volume(displacements: Displacements, modes: np.ndarray) -> np.ndarray:
    """Integrals of displacements times shape functions over the body, ``shape=(owned dofs, m)``.
    Collective.

    Args:
        displacements: ``Displacements``.
        modes: Displacements, owned degrees of freedom, ``shape=(owned dofs, m)``.
    """
    z, integral = fem.Function(displacements.V), fem.Function(displacements.V)
    form = fem.form(ufl.inner(z, ufl.TestFunction(displacements.V)) * ufl.dx)
    columns, size = [], displacements.count * displacements.dim
    for mode in modes.T:
        z.x.array[:size] = displacements.rows(mode).ravel()
        z.x.scatter_forward()
        compat.assemble_into(integral.x, form)
        columns.append(
            integral.x.array[:size].reshape(displacements.count, displacements.dim).copy()
        )
    return displacements.vectors(np.stack(columns, axis=-1))
