# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The judge (judge.py) on a DOLFINx scene: dense stiffness and loads from ``F``, nodes from facets, by DOLFINx alone.

Of the package's objects it reads ``nodes``, ``frame``, ``reaction`` and ``slip_before_touching`` of the contact, and ``u``.
"""

from __future__ import annotations

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem

from mechanics import judge


class SceneJudge:
    """Judges step after step of a scene with the attributes V, u, F, bcs, held, contact, facets, axes.

    Args:
        scene: ``held`` is the Function of the boundary values; ``contact`` may be None.
        mu, p: Coefficients as the scene was given them; p None for the associated rule.
    """

    def __init__(self, scene, mu, p=None):
        self.scene = scene
        trial = ufl.TrialFunction(scene.V)
        matrix = dolfinx.fem.petsc.assemble_matrix(
            fem.form(ufl.derivative(scene.F, scene.u, trial))
        )
        matrix.assemble()
        K = matrix[:, :]
        matrix.destroy()
        x = scene.V.tabulate_dof_coordinates()
        d = scene.V.dofmap.index_map_bs
        self.form = fem.form(scene.F)
        self.fixed = np.unique(np.concatenate([bc.dof_indices()[0] for bc in scene.bcs] + [np.zeros(0, int)]))  # fmt: skip
        frame = np.eye(d)
        nodes = np.zeros(0, dtype=int)
        if scene.contact is not None:
            frame = np.array(scene.contact.frame)
            nodes = np.sort(fem.locate_dofs_topological(scene.V, d - 1, scene.facets))
            turn = scene.axes[:d, :d]
            if np.abs(frame @ turn[:, -1] - np.eye(d)[-1]).max() > 1e-12:
                raise AssertionError("the frame of the contact does not have the scene's normal")
        self.nodes = nodes
        contact = d * nodes[:, None] + np.arange(d)
        mu = np.broadcast_to(np.asarray(mu, float), (d - 1,))
        p = mu if p is None else np.broadcast_to(np.asarray(p, float), (d - 1,))
        gap0 = x[nodes, :d] @ frame[-1]
        # Coordinates are rounded like the largest one: a face that is meant to lie in the plane may not, by a last digit.
        reach = np.full(len(nodes), np.abs(x).max(initial=0.0))
        self.body = judge.Body(K, contact, self.fixed, frame, gap0, reach, mu, p)
        # Unique whatever the mesh: no slip rule of its own, and little friction.
        self.unique = bool(np.all(mu == mu[0]) and np.all(p == p[0]) and mu[0] <= 0.2)
        self.restart()

    def restart(self):
        """The undeformed body, from which the next step starts."""
        self.before, self.farthest = np.zeros(self.scene.u.x.array.size), 0.0

    def forces(self) -> np.ndarray:
        """External forces: minus F at no displacement."""
        u = self.scene.u.x.array
        values = u.copy()
        u[:] = 0.0
        found = fem.assemble_vector(self.form)
        u[:] = values
        return -np.array(getattr(found, "array", found))

    def verdict(self, tol: float) -> judge.Verdict:
        """Of the step that was just solved; its displacement is where the next one starts."""
        scene, u = self.scene, self.scene.u.x.array.copy()
        reaction = np.zeros((self.nodes.size, len(self.body.frame)))
        if scene.contact is not None:
            order = [int(np.flatnonzero(scene.contact.nodes == i)[0]) for i in self.nodes]
            reaction = np.array(scene.contact.reaction)[order]
            slipped = np.array(scene.contact.slip_before_touching)[order]
            self.before.reshape(-1, len(self.body.frame))[self.nodes] += (
                slipped @ self.body.frame[:-1]
            )
        held = scene.held.x.array[self.fixed]
        found = self.body.verdict(
            u, reaction, self.forces(), self.before, held, tol, self.unique, self.farthest
        )
        self.before, self.farthest = u, max(self.farthest, np.abs(u).max(initial=0.0))
        return found
