# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Internal variables of a material, updated by converged steps and unchanged by failed ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.support.attributes import Guarded
from dolfinx_contact.support.collective import raised_together
from dolfinx_contact.support.numbering import original_cells


class InternalVariables(Guarded):
    """Internal variables of a material, and the user's functions that update them.

    Examples of internal variables are plastic strains, hardening or viscous stresses.

    Args:
        state: The user's Functions.  A failed step leaves them unchanged; checkpoints contain them.
        before_residual: None, or ``f(u)``, called before each assembly of F or J.  It sets their
            coefficients from ``u`` and ``state``, and must not change ``state``.
            ``ContactProblem`` then needs ``J``.
        after_step: None, or ``f(u)``, called once after every converged step.  It updates
            ``state``.

    Raises:
        ValueError: an entry of ``state`` is not a Function, or one of the other arguments is not
            callable.

    Example:
        >>> creep = fem.Function(V)
        >>> def flow(u): creep.x.array[:] += 0.1 * (u.x.array - creep.x.array)
        >>> internal = dc.InternalVariables([creep], after_step=flow)
        >>> contact = dc.Contact(V, foot, plane, friction)
        >>> creeping = dc.ContactProblem(F, u, contact, bcs=[bc], internal=internal)
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
        """Return copies of the present values of all internal variables, ghosts included."""
        return tuple(function.x.array.copy() for function in self.state)

    def put(self, values: Sequence[np.ndarray]) -> None:
        """Restore the internal variables to values that ``values`` returned."""
        for function, array in zip(self.state, values):
            function.x.array[:] = array

    def move_on(self, u: fem.Function) -> None:
        """Call the user's ``after_step`` with the converged displacement.  Collective."""
        if self.after_step is not None:
            with raised_together(u.function_space.mesh.comm):
                self.after_step(u)

    # -- checkpoints ---------------------------------------------------------------------------

    def cells(self) -> dict[str, np.ndarray]:
        """Return a dictionary with original indices of this rank's cells, empty without variables.
        Collective.
        """
        if not self.state:
            return {}
        meshes = [function.function_space.mesh for function in self.state]
        with raised_together(meshes[0].comm):
            if any(mesh.ufl_domain() != meshes[0].ufl_domain() for mesh in meshes):
                raise ValueError("a checkpoint holds state on one mesh: put all of it there.")
            return {"state_nodes": original_cells(meshes[0])}

    def save(self) -> dict[str, np.ndarray]:
        """Return arrays for a checkpoint: cell indices and values, one row for each cell."""
        rows = self.cells()
        for k, function in enumerate(self.state):
            dofs = compat.cell_dofs(function.function_space)
            rows[f"state_{k}"] = function.x.array[dofs[: len(rows["state_nodes"])]]
        return rows

    def loaded(self, rows: dict[str, np.ndarray]) -> tuple[np.ndarray, ...]:
        """Restore the internal variables from a checkpoint, and return their values.  Collective.

        Args:
            rows: Arrays that ``save`` returned, reordered to the cells owned by this rank.
        """
        for k, function in enumerate(self.state):
            values, dofs = rows[f"state_{k}"], compat.cell_dofs(function.function_space)
            function.x.array[dofs[: len(values)]] = values
            function.x.scatter_forward()
        return self.values()
