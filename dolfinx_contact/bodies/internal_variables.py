# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Functions of the user that a step moves on, and that a rejected step leaves as they were."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.support.attributes import Guarded
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.support.numbering import original_cells


class InternalVariables(Guarded):
    """Internal variables of a material, such as plastic strains, hardening or viscous stresses, and the user's functions that
    update them.

    Args:
        state: The user's Functions.  A failed step leaves them unchanged; checkpoints contain them.
        before_residual: None, or ``f(u)``, called before each assembly of F or J.  It sets their coefficients from ``u`` and
            ``state``, and must not change ``state``.  ``ContactProblem`` then needs ``J``.
        after_step: None, or ``f(u)``, called once after every converged step.  It updates ``state``.

    Raises:
        ValueError: an entry of ``state`` is not a Function, or one of the other arguments is not callable.

    Example:
        >>> creep = fem.Function(V)
        >>> def flow(u): creep.x.array[:] += 0.1 * (u.x.array - creep.x.array)
        >>> internal = dc.InternalVariables([creep], after_step=flow)
        >>> creeping = dc.ContactProblem(F, u, dc.Contact(V, foot, plane, friction), bcs=[bc], internal=internal)
    """

    _remedy = "make new InternalVariables, and a ContactProblem with them."

    def __init__(
        self,
        state: Sequence[fem.Function] | fem.Function = (),
        *,
        before_residual: Callable[[fem.Function], object] | None = None,
        after_step: Callable[[fem.Function], object] | None = None,
    ) -> None:
        state = [state] if isinstance(state, fem.Function) else state
        if not isinstance(state, (list, tuple)):
            raise ValueError(f"state must be a list of DOLFINx Functions, got {state!r}.")
        for function in state:
            if not isinstance(function, fem.Function):
                raise ValueError(
                    f"state must hold DOLFINx Functions, got {type(function).__name__}."
                )
        for name, call in (("before_residual", before_residual), ("after_step", after_step)):
            if not (call is None or callable(call)):
                raise ValueError(f"{name} must be a function of u, got {call!r}.")
        self.state, self.before_residual, self.after_step = list(state), before_residual, after_step
        self._made = True

    def values(self) -> tuple[np.ndarray, ...]:
        """What they are now, for ``put``."""
        return tuple(function.x.array.copy() for function in self.state)

    def put(self, values: Sequence[np.ndarray]) -> None:
        """Let them be what they were."""
        for function, array in zip(self.state, values):
            function.x.array[:] = array

    def move_on(self, u: fem.Function) -> None:
        """Let the user move them on with the converged displacement.  Collective."""
        if self.after_step is not None:
            with raised_together(u.function_space.mesh.comm):
                self.after_step(u)

    # -- checkpoints ---------------------------------------------------------------------------

    def cells(self) -> dict[str, np.ndarray]:
        """Original indices of this rank's cells, by the name of rows; nothing without functions.  Collective."""
        if not self.state:
            return {}
        meshes = [function.function_space.mesh for function in self.state]
        with raised_together(meshes[0].comm):
            if any(mesh.ufl_domain() != meshes[0].ufl_domain() for mesh in meshes):
                raise ValueError("a checkpoint holds state on one mesh: put all of it there.")
            return {"state_nodes": original_cells(meshes[0])}

    def save(self) -> dict[str, np.ndarray]:
        """Cells, and the values of each function, a row a cell."""
        rows = self.cells()
        for k, function in enumerate(self.state):
            dofs = compat.cell_dofs(function.function_space)
            rows[f"state_{k}"] = function.x.array[dofs[: len(rows["state_nodes"])]]
        return rows

    def loaded(self, rows: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
        """The values, as ``values`` returns them, of what ``save`` returned, for the cells that this rank owns; they are put, too.  Collective."""
        for k, function in enumerate(self.state):
            values, dofs = rows[f"state_{k}"], compat.cell_dofs(function.function_space)
            function.x.array[dofs[: len(values)]] = values
            function.x.scatter_forward()
        return self.values()
