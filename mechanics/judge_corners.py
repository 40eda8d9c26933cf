# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The judge's law (judge_law.py) on bodies whose nodes belong to several contacts; any number of ranks.

Each contact is judged by its own reactions, gaps and slips, computed here from points and normals; equilibrium with the sum
of all, by the form.  How the sum at a node is split is not unique, and no distance of the reactions from a tight solution is
given.  Of the package's objects it reads ``nodes``, ``frame``, ``reaction`` and ``slip_before_touching`` of contacts, ``displacement`` of planes, and ``u``.
"""

from __future__ import annotations

import dolfinx.fem.petsc
import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from mechanics.judge import EPS, Verdict
from mechanics.judge_law import law_defects


class CornerJudge:
    """Judges step after step of a scene of ``corners.build_corner``, or of one like it.

    Args:
        scene: With ``V``, ``u``, ``F``, ``bcs``, ``contacts``, and of each contact ``normals``, ``points``, ``mu``, ``p``; ``E``, ``length``.
    """

    def __init__(self, scene):
        self.scene, self.d = scene, scene.V.mesh.geometry.dim
        self.size = scene.V.dofmap.index_map.size_local * self.d
        self.x = scene.V.tabulate_dof_coordinates()[:, : self.d]
        self.before = np.zeros_like(self.x)
        self.moved = [np.zeros(self.d) for _ in scene.contacts]
        # A node's stiffness, about.
        self.stiff = scene.E * (scene.length / max(getattr(scene, "cells", (4,)))) ** (self.d - 2)

    def _internal(self) -> np.ndarray:
        vector = dolfinx.fem.petsc.assemble_vector(fem.form(self.scene.F))
        vector.ghostUpdate(PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE)
        forces = vector.array_r.copy()
        vector.destroy()
        return forces

    def _norm(self, *arrays) -> float:
        largest = max((float(np.abs(a).max(initial=0.0)) for a in arrays), default=0.0)
        largest = self.scene.V.mesh.comm.allreduce(largest, op=MPI.MAX) or 1.0
        total = sum(float((np.square(a / largest)).sum()) for a in arrays)
        return largest * float(np.sqrt(self.scene.V.mesh.comm.allreduce(total)))

    def verdict(self) -> Verdict:
        """Of the step that was just solved."""
        scene, d = self.scene, self.d
        u = scene.u.x.array.reshape(-1, d)[: len(self.x)]
        left, reactions, terms = self._internal(), [], []
        supports = left.copy()
        parts = {"normal": [], "cone": [], "slip": []}
        acting = np.zeros_like(left)
        fixed = np.zeros(left.size, dtype=bool)
        for bc in scene.bcs:
            dofs = bc.dof_indices()[0]
            fixed[dofs[dofs < left.size]] = True
        for k, contact in enumerate(scene.contacts):
            normal, moved = scene.normals[k], np.array(contact.surface.displacement)
            point = -scene.gap * normal if hasattr(scene, "gap") else np.zeros(d)
            tangents = np.linalg.svd(normal[None, :])[2][1:]
            if d == 3 and scene.axes is not None:  # the plane's axis first
                first = np.array(scene.axes[2])
                tangents = np.array([first, np.cross(normal, first)])
            nodes = contact.nodes
            force = contact.reaction @ contact.frame
            r = np.column_stack((force @ tangents.T, force @ normal))
            gap = (self.x[nodes] + u[nodes] - point - moved) @ normal
            way = u[nodes] - self.before[nodes] - moved + self.moved[k]
            slip = (way - contact.slip_before_touching @ contact.frame[:-1]) @ tangents.T
            self.moved[k] = moved
            mu = np.broadcast_to(scene.mu[k], d - 1).astype(float)
            p = mu if scene.p[k] is None else np.broadcast_to(scene.p[k], d - 1).astype(float)
            stiff = np.full(len(nodes), self.stiff)
            K_t = stiff[:, None, None] * np.eye(d - 1)
            # Nodes whose motion along the normal is given carry nothing: the contact leaves them to the supports.
            left_out = (fixed.reshape(-1, d)[nodes] | (np.abs(normal) < 1e-12)).all(axis=1)
            for name, values in zip(parts, law_defects(r, gap, slip, stiff, K_t, mu, p)):
                carried = np.linalg.norm(r, axis=1)
                parts[name].append(np.where(left_out, carried, values))
            np.subtract.at(left.reshape(-1, d), nodes, force)
            np.add.at(acting.reshape(-1, d), nodes, np.abs(force))
            reactions.append(force)
            terms.append(self.stiff * (np.abs(self.x[nodes]) + np.abs(u[nodes]) + np.abs(moved)))
        left[fixed] = 0.0
        farthest = scene.V.mesh.comm.allreduce(float(np.abs(u).max(initial=0.0)), op=MPI.MAX)
        thin = np.sin(
            np.deg2rad(getattr(scene, "angle", 90.0))
        )  # stiffnesses of slivers are as much larger
        cancelling = np.full(left.size, 10 * self.stiff / thin * farthest) + acting
        external = np.where(fixed, supports, 0.0)
        scale = max(self._norm(*reactions), self._norm(external))
        defects = {name: self._norm(*values) for name, values in parts.items()}
        allowances = {"normal": EPS * self._norm(*terms), "cone": EPS * self._norm(*reactions), "slip": EPS * self._norm(*terms)}  # fmt: skip
        defects["equilibrium"], allowances["equilibrium"] = self._norm(left), EPS * self._norm(cancelling)  # fmt: skip
        defects["reactions"] = allowances["reactions"] = 0.0
        self.before = u.copy()
        return Verdict(scale, scale, defects, allowances)
