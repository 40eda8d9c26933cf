# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The judge (judge.py) on bodies over planes, balls and rollers that force drives.

Gaps, normals and lever arms are computed here from points, radii and quaternions; equilibrium of the surface is a sum of nodal
forces.  Both are those of the start of a step: it has to be solved with an infinite ``geometry_tol``.  For the motion that was
found the body is judged as over a surface that moves so.  Of the package's objects it
reads ``nodes``, ``frame``, ``reaction`` and ``slip_before_touching`` of the contact, ``displacement`` and ``rotation`` of the surface, and ``u``.
"""

from __future__ import annotations

import dolfinx.fem.petsc
import numpy as np
import ufl
from dolfinx import fem

from mechanics import judge
from mechanics.judge import EPS


def half(angle: np.ndarray) -> tuple[float, np.ndarray]:
    """The unit quaternion of a rotation vector: cosine and axis times sine of half the angle."""
    a = np.linalg.norm(angle)
    return np.cos(a / 2), angle / 2 * np.sinc(a / (2 * np.pi))


def turned(angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors, rows, after a rotation."""
    w, s = half(angle)
    across = np.cross(s, vectors)
    return vectors + 2 * w * across + 2 * np.cross(s, across)


def between(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation vector that leads from one rotation to another, a small one, with all digits."""
    (w0, s0), (w1, s1) = half(before), half(after)
    v = w0 * s1 - w1 * s0 - np.cross(s1, s0)
    size = np.linalg.norm(v)
    return 2 * v if size == 0.0 else 2 * np.arcsin(size) * v / size


def _across(vectors: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Parts of vectors across normals, rows."""
    return vectors - (vectors * n).sum(axis=1)[:, None] * n


class RigJudge:
    """Judges step after step of a scene of ``rigs.build_rig``.

    Args:
        scene: What ``build_rig`` made.
        mu, p: Coefficients as the scene was given them; p None for the associated rule.
    """

    def __init__(self, scene, mu, p=None):
        self.scene, trial = scene, ufl.TrialFunction(scene.V)
        matrix = dolfinx.fem.petsc.assemble_matrix(
            fem.form(ufl.derivative(scene.F, scene.u, trial))
        )
        matrix.assemble()
        self.K = matrix[:, :]
        matrix.destroy()
        self.x = scene.V.tabulate_dof_coordinates()
        self.nodes = np.sort(fem.locate_dofs_topological(scene.V, 2, scene.facets))
        self.fixed = np.unique(np.concatenate([bc.dof_indices()[0] for bc in scene.bcs]))
        self.mu = np.broadcast_to(np.asarray(mu, float), 2)
        self.p = self.mu if p is None else np.broadcast_to(np.asarray(p, float), 2)
        self.unique = bool(
            np.all(self.mu == self.mu[0]) and np.all(self.p == self.p[0]) and self.mu[0] <= 0.2
        )
        self.order = [int(np.flatnonzero(scene.contact.nodes == i)[0]) for i in self.nodes]
        self.before, self.farthest = np.zeros(self.x.shape), 0.0
        self.moved, self.angle, self.gap = np.zeros(3), np.zeros(3), None

    def _geometry(self, there, moved, angle):
        """Distances and frames (t1, t2, n) of positions from the surface where it stands."""
        scene, x = self.scene, np.eye(3)[0]
        arms = there - scene.point - moved
        if scene.kind == "plane":
            t1, _, n = turned(angle, np.eye(3))
            return arms @ n, np.broadcast_to([t1, np.cross(n, t1), n], (len(arms), 3, 3))
        if scene.kind == "roller":
            arms, x = arms * [1, 0, 1], np.eye(3)[1]
        length = np.sqrt((arms**2).sum(axis=1))
        n = arms / length[:, None]
        t1 = x - n[:, :1] * n if scene.kind == "ball" else np.broadcast_to(x, n.shape)
        t1 = t1 / np.sqrt((t1**2).sum(axis=1))[:, None]
        return length - scene.radius, np.stack((t1, np.cross(n, t1), n), axis=1)

    def _way_up(self, there, moved) -> float:
        """How far up a ball or roller that no node touches goes before the step."""
        scene = self.scene
        if self._geometry(there, moved, self.angle)[0].min() <= 1e-12 * np.abs(self.x).max():
            return 0.0
        away = (there - scene.point - moved)[:, : 2 if scene.kind == "ball" else 1]
        off = (away**2).sum(axis=1)
        under = off < scene.radius**2
        # R - sqrt(R^2 - off), without cancelling
        fall = off[under] / (scene.radius + np.sqrt(scene.radius**2 - off[under]))
        top = scene.point[2] + scene.radius + moved[2]
        return float((there[under, 2] + fall).min() - top)

    def _along(self, there, start) -> np.ndarray:
        """By what ways along the ball or roller, up to where it starts, are more than ways along the tangent planes there, ``shape=(n, 3)``.

        Ways are arcs between nearest points; the last step left nodes as far from theirs as its tangent planes said.
        """
        kept = [1, 0, 1] if self.scene.kind == "roller" else [1, 1, 1]
        began, ends = ((there - self.scene.point - at) * kept for at in (self.moved, start))
        if self.scene.kind == "plane" or not (ends - began).any():
            return np.zeros_like(ends)
        (n0, far), (n, distance) = map(self._radial, (began, ends))
        gap = far if self.gap is None else self.gap
        chord = ends - began - distance[:, None] * n + gap[:, None] * n0
        half_turn = 0.5 * np.arctan2(np.linalg.norm(np.cross(n0, n), axis=1), (n0 * n).sum(axis=1))
        middle = (n0 + n) / np.linalg.norm(n0 + n, axis=1)[:, None]
        way = _across(ends - began, n)
        length = np.linalg.norm(way, axis=1)
        arc = np.linalg.norm(_across(chord, middle), axis=1) / np.sinc(half_turn / np.pi)
        return (np.divide(arc, length, np.ones_like(arc), where=length > 0) - 1)[:, None] * way

    def _radial(self, arms) -> tuple[np.ndarray, np.ndarray]:
        """Normals of a ball or roller at these arms of its middle, and distances."""
        length = np.linalg.norm(arms, axis=1)
        return arms / length[:, None], length - self.scene.radius

    def verdict(self, asked, tol: float) -> judge.Verdict:
        """Of the step that was just solved under what ``apply`` returned."""
        scene, surface = self.scene, self.scene.surface
        there = (self.x + self.before)[self.nodes]
        start = asked.moved
        if scene.kind != "plane":
            start = start + [0.0, 0.0, self._way_up(there, start)]
        distance, frames = self._geometry(there, start, self.angle)
        arms = there - scene.point - start
        ended, spin = (
            np.array(surface.displacement),
            between(self.angle, np.array(surface.rotation)),
        )
        swung = np.cross(spin, arms)
        u = scene.u.x.array.reshape(-1, 3).copy()
        force = np.einsum("ni,nij->nj", scene.contact.reaction, np.broadcast_to(scene.contact.frame, (len(arms), 3, 3)))  # fmt: skip
        force = force[self.order]

        T = np.eye(len(self.K))
        for node, frame in zip(self.nodes, frames):
            T[3 * node : 3 * node + 3, 3 * node : 3 * node + 3] = frame
        gap0 = distance - np.einsum(
            "nj,nj->n", frames[:, -1], self.before[self.nodes] + ended - start + swung
        )
        last = self.before.copy()
        last[self.nodes] += ended - self.moved + swung
        slipped = np.einsum("ni,nij->nj", scene.contact.slip_before_touching, np.broadcast_to(scene.contact.frame, (len(arms), 3, 3))[:, :-1])  # fmt: skip
        last[self.nodes] += slipped[self.order] - self._along(there, start)
        reach = np.full(
            len(arms), np.abs(self.x).max() + np.abs(scene.point).max() + np.abs(ended).max()
        )
        contact = 3 * self.nodes[:, None] + np.arange(3)
        body = judge.Body(
            T @ self.K @ T.T, contact, self.fixed, np.eye(3), gap0, reach, self.mu, self.p
        )
        reaction = np.einsum("nij,nj->ni", frames, force)
        found = body.verdict(
            T @ u.ravel(), reaction, np.zeros(u.size), T @ last.ravel(), np.zeros(self.fixed.size), tol, self.unique,
            self.farthest,
        )  # fmt: skip
        self._balance(
            found,
            force,
            arms,
            asked,
            ended - asked.moved,
            np.abs(ended).sum() + np.abs(asked.moved).sum(),
        )
        self.gap = gap0 + np.einsum("nj,nj->n", frames[:, -1], u[self.nodes])
        self.before, self.moved, self.angle = u, ended, np.array(surface.rotation)
        self.farthest = max(self.farthest, np.abs(u).max())
        return found

    def _free_lengths(self) -> np.ndarray:
        return np.array(
            [
                bool(set(names) & set(self.scene.free))
                for names in (("t1", "x"), ("t2", "y"), ("n", "z"))
            ]
        )

    def _balance(self, found, force, arms, asked, way, reach) -> None:
        """Forces and moments on the surface that are left along what is free, the latter over the largest arm.

        Along what is not, its way has to be nothing.
        """
        # Guides of a plane turn with it where its rotation is given, not where it is free.
        tilts = {"r1", "r2", "rn"} & set(self.scene.free)
        plain = self.scene.kind == "plane" and not tilts
        axes = turned(self.angle, np.eye(3)) if plain else np.eye(3)
        if np.abs(axes[~self._free_lengths()] @ way).max(initial=0.0) > EPS * reach:
            found.notes.append("the surface left its guide")
        left, terms = [], []
        along = [axes[k] for k in np.flatnonzero(self._free_lengths())]
        for axis in along:
            left.append(force.sum(axis=0) @ axis - asked.force @ axis)
            terms.append(
                np.abs(force).sum(axis=0) @ np.abs(axis) + np.abs(asked.force) @ np.abs(axis)
            )
        length = np.sqrt((arms**2).sum(axis=1)).max()
        moments = np.cross(arms, force)
        for name, axis in zip(("r1", "r2", "rn"), axes):
            if name in self.scene.free:
                left.append((moments.sum(axis=0) - asked.moment) @ axis / length)
                terms.append(np.abs(force).sum() + np.abs(asked.moment).sum() / length)
        found.defects["surface"] = float(np.linalg.norm(left))
        found.allowances["surface"] = EPS * float(np.linalg.norm(terms))
