# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Functions of the user that a step moves on, and that a rejected step leaves as they were."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.support.numbering import original_cells


class InternalVariables:
    """Functions that are state: plastic strains, hardening, viscous stresses.

    Args:
        functions: The user's Functions.
        after_step: None, or the user's function of ``u``, called once after every converged step.

    Raises:
        ValueError: something that is no Function, or cannot be called.
    """

    def __init__(self, functions: Sequence[fem.Function], after_step: Callable | None):
        functions = [functions] if isinstance(functions, fem.Function) else functions
        if not isinstance(functions, (list, tuple)):
            raise ValueError(f"state must be a list of DOLFINx Functions, got {functions!r}.")
        for function in functions:
            if not isinstance(function, fem.Function):
                raise ValueError(
                    f"state must hold DOLFINx Functions, got {type(function).__name__}."
                )
        if after_step is not None and not callable(after_step):
            raise ValueError(f"after_step must be a function of u, got {after_step!r}.")
        self._functions, self._after = list(functions), after_step
        self._first = self.last = self._values()

    def _values(self) -> list[np.ndarray]:
        return [function.x.array.copy() for function in self._functions]

    def reset(self) -> None:
        """Back to what they were when the problem was made."""
        self.go_back(self._first)

    def go_back(self, values: list[np.ndarray]) -> None:
        """Back to what ``history`` returned."""
        self.last = values
        self.restore()

    def restore(self) -> None:
        """Back to the last converged state."""
        for function, values in zip(self._functions, self.last):
            function.x.array[:] = values

    def move_on(self, u: fem.Function) -> None:
        """Let the user move them on with the converged displacement.  Collective."""
        if self._after is not None:
            with raised_together(u.function_space.mesh.comm):
                self._after(u)

    def history(self) -> list[np.ndarray]:
        """All that a step leaves to the next one, for ``go_back``."""
        return self.last

    def advance(self) -> None:
        """What they are is the last converged state."""
        self.last = self._values()

    # -- checkpoints ---------------------------------------------------------------------------

    def cells(self) -> dict[str, np.ndarray]:
        """Original indices of this rank's cells, by the name of rows; nothing without functions.  Collective."""
        if not self._functions:
            return {}
        meshes = [function.function_space.mesh for function in self._functions]
        with raised_together(meshes[0].comm):
            if any(mesh.ufl_domain() != meshes[0].ufl_domain() for mesh in meshes):
                raise ValueError("a checkpoint holds state on one mesh: put all of it there.")
            return {"state_nodes": original_cells(meshes[0])}

    def save(self) -> dict[str, np.ndarray]:
        """Cells, and the values of each function, a row a cell."""
        rows = self.cells()
        for k, function in enumerate(self._functions):
            dofs = compat.cell_dofs(function.function_space)
            rows[f"state_{k}"] = function.x.array[dofs[: len(rows["state_nodes"])]]
        return rows

    def load(self, rows: dict[str, np.ndarray]) -> None:
        """Take back what ``save`` returned, for the cells that this rank owns.  Collective."""
        for k, function in enumerate(self._functions):
            values, dofs = rows[f"state_{k}"], compat.cell_dofs(function.function_space)
            function.x.array[dofs[: len(values)]] = values
            function.x.scatter_forward()
        self.advance()
