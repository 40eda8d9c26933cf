# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A judge of two deformable bodies, written from the mechanics; it shares no definition with the package.

Forces on nodes are what the form leaves, ``K u``: equilibrium and supports are judged without any coefficient between the meshes.  They have
to balance between both faces, also about a point, and on the slave's nodes they obey the law (judge_law.py).  Gaps and slips are differences of the
moved faces at points of the slave's facets.  Where meshes do not match they are zero in a mean over a node's facets, not at each point: allowed is
what their range over these facets explains.  Work of the supports is elastic energy and the dissipation that is reported, up to what the way
from one state to the next leaves open.  Of the package's objects it reads ``nodes``, ``frame``, ``reaction`` and ``dissipation`` of the contact, and ``u``.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from dolfinx import fem
from scipy.interpolate import LinearNDInterpolator

from dolfinx_contact.compat import functionspace
from mechanics.judge import EPS, Verdict
from mechanics.judge_law import law_defects, norm

PARTS = 4  # of a facet's edges: points at which faces are compared
RANGE = 3.0  # ranges that a value may be from zero if a mean of it by a dual shape function is zero
OPPOSITE = 0.75  # part of a node's points that has to be opposite the other body, else nothing is said of its gap
BAR = 10.0  # times the tolerance: error of the closed form of a bar


class Face:
    """Points on the facets of one body, where they are and how they have moved, in the scene's axes."""

    def __init__(self, scene, facets):
        self.scene, V, mesh = scene, scene.V, scene.mesh
        d = mesh.geometry.dim
        vertices = functionspace(mesh, ("Lagrange", 1))
        at = vertices.tabulate_dof_coordinates()
        mesh.topology.create_connectivity(d - 1, d)
        cells = mesh.topology.connectivity(d - 1, d)
        self.nodes = np.sort(fem.locate_dofs_topological(V, d - 1, facets))
        points, self.cells, near = [], [], []
        for facet in np.asarray(facets, dtype=np.int32):
            corners = at[fem.locate_dofs_topological(vertices, d - 1, facet[None])]
            mean = np.array(list(combinations_with_replacement(range(len(corners)), PARTS)))
            points.append(corners[mean].mean(axis=1))
            self.cells += [cells.links(facet)[0]] * len(mean)
            of = fem.locate_dofs_topological(V, d - 1, facet[None])
            near.append(np.isin(self.nodes, of))
        self.points, self.near = np.concatenate(points), np.array(near)
        self.count = len(points[0])
        self.x = self.points[:, :d] @ scene.turn

    def moved(self, u) -> np.ndarray:
        """Displacement of the points, ``shape=(m, d)``."""
        return u.eval(self.points, np.array(self.cells, dtype=np.int32)) @ self.scene.turn

    def of_nodes(self, values, take) -> np.ndarray:
        """A function of all values at the points of a node's facets, for each node."""
        by_facet = values.reshape(len(self.near), self.count, -1)
        return np.array([take(by_facet[of].reshape(-1, by_facet.shape[-1])) for of in self.near.T])


def beneath(there, values, at):
    """Values of points of one face at places ``at`` along it, ``shape=(m, k)``; nan where there is none."""
    if there.shape[1] > 1:
        return LinearNDInterpolator(there, values, rescale=True)(at)
    order = np.argsort(there[:, 0], kind="stable")
    return np.column_stack([np.interp(at[:, 0], there[order, 0], v[order], np.nan, np.nan) for v in values.T])  # fmt: skip


class TwoBodiesJudge:
    """Judges step after step of a scene of ``two_blocks.build_two``."""

    def __init__(self, scene):
        self.scene, self.form = scene, fem.form(scene.F)
        self.d = scene.mesh.geometry.dim
        self.x = scene.V.tabulate_dof_coordinates()[:, : self.d] @ scene.turn
        self.faces = Face(scene, scene.slave), Face(scene, scene.master)
        self.fixed = np.unique(np.concatenate([bc.dof_indices()[0] for bc in scene.bcs]))
        self.before = fem.Function(scene.V)
        self.left = np.zeros_like(self.before.x.array)  # forces on nodes
        self.dissipated = 0.0  # work of friction
        self.pressed = np.zeros(self.faces[0].nodes.size, dtype=bool)
        mu = np.broadcast_to(np.asarray(scene.mu, float), self.d - 1)
        self.mu, self.p = mu, mu if scene.p is None else np.broadcast_to(scene.p, self.d - 1)
        self.stiff = min(scene.moduli) * (scene.length / 4) ** (self.d - 2)
        self.gaps = self._geometry()[0]

    def verdict(self, down: float, tol: float, admitted: float = 0.0) -> Verdict:
        """Of the step that was just solved.

        Args:
            down: Way of the head.
            tol: Of the closed form of a bar.
            admitted: Tolerance of the geometry at its end, relative: of forces and directions.
        """
        scene, d = self.scene, self.d
        slave, master = self.faces
        left = fem.assemble_vector(self.form).array.copy()
        force = left.reshape(-1, d) @ scene.turn
        on_slave, on_master = force[slave.nodes], force[master.nodes]
        free = np.ones(left.size, dtype=bool)
        free[self.fixed] = False
        for face in self.faces:
            free[(d * face.nodes[:, None] + np.arange(d)).ravel()] = False
        acting = norm(on_slave), norm(left[self.fixed])
        scale, terms = max(acting), EPS * self.stiff_terms()
        gaps, slips, normals, spread, sag = self._geometry()
        spread = spread + admitted
        reported = np.zeros_like(on_slave)
        at = np.searchsorted(slave.nodes, scene.contact.nodes)
        reported[at] = np.einsum("ni,nij->nj", scene.contact.reaction, np.broadcast_to(scene.contact.frame, (len(at), d, d))) @ scene.turn  # fmt: skip
        moved = self._supports()
        defects = dict(
            equilibrium=norm(left[free]), supports=moved, balance=norm(on_slave.sum(axis=0) + on_master.sum(axis=0)),
            moment=self._moment(on_slave, on_master, gaps, sag + admitted * scene.length), reported=norm(reported - on_slave),
            **self._law(on_slave, gaps, slips, normals, spread), energy=self._energy(left, gaps, slips, sag + admitted * scene.length),
        )  # fmt: skip
        found = Verdict(scale, acting[0], defects, dict.fromkeys(defects, terms))
        defects["reactions"] = found.allowances["reactions"] = 0.0
        self._bar(found, scene.sign * on_slave[:, -1].sum(), down, tol)
        self.pressed = np.linalg.norm(on_slave, axis=1) > 0.0
        self.pressed &= norm(on_slave) > terms
        self.before.x.array[:] = scene.u.x.array
        return found

    def stiff_terms(self) -> float:
        """What cancels in a node's balance: the stiffer body's forces."""
        scene = self.scene
        stiff = max(scene.moduli) * (scene.length / 4) ** (self.d - 2) * scene.thin
        return 10 * stiff * norm(scene.u.x.array)

    def _supports(self) -> float:
        u, off = self.scene.u.x.array, 0.0
        for bc in self.scene.bcs:
            dofs = bc.dof_indices()[0]
            given = self.scene.held.x.array[dofs] if bc is self.scene.bcs[0] else 0.0
            off = max(off, np.abs(u[dofs] - given).max())
        return self.stiff * off

    def _geometry(self):
        """Of the slave's nodes: gaps and slips at their facets' points, normals of the facets, how far these turn, and how far facets are from planes."""
        scene, slave = self.scene, self.faces[0]
        large, sign = scene.sliding == "large", scene.sign
        ends = [face.moved(scene.u) for face in self.faces]
        steps = [by - face.moved(self.before) for face, by in zip(self.faces, ends)]
        there = [face.x + by for face, by in zip(self.faces, ends)]
        along = [(y if large else face.x)[:, :-1] for face, y in zip(self.faces, there)]
        under = beneath(along[1], np.column_stack((there[1][:, -1], steps[1])), along[0])
        gaps = sign * (there[0][:, -1:] - under[:, :1])
        slips = steps[0][:, :-1] - under[:, 1:-1]
        faces = (there[0] if large else slave.x).reshape(len(slave.near), slave.count, -1)
        sizes, ways = zip(*(np.linalg.svd(x - x.mean(axis=0))[1:] for x in faces))
        n = np.array(ways)[:, -1]
        n = sign * n * np.sign(n[:, -1:])
        sizes = np.array(sizes)
        curved = 4 * sizes[:, -1] / sizes[:, 0]
        mean = slave.near.T @ n
        mean = mean / np.linalg.norm(mean, axis=1, keepdims=True)
        turns = np.linalg.norm(n[None] - mean[:, None], axis=2) + curved
        sag = [np.abs((x - x.mean(axis=0)) @ of).max() for x, of in zip(faces, n)]
        return (
            gaps,
            slips,
            mean,
            (slave.near.T * turns).max(axis=1),
            (slave.near.T * sag).max(axis=1),
        )

    def _law(self, force, gaps, slips, normals, spread) -> dict:
        slave, d = self.faces[0], self.d
        covered = slave.of_nodes(gaps, lambda g: np.isfinite(g).mean())
        some = covered >= OPPOSITE

        def middle(g):
            return (np.nanmax(g, axis=0) + np.nanmin(g, axis=0)) / 2 if np.isfinite(g).any() else 0.0 * g[0]  # fmt: skip

        def extent(g):
            return np.linalg.norm(np.nanmax(g, axis=0) - np.nanmin(g, axis=0)) if np.isfinite(g).any() else 0.0  # fmt: skip

        gap, slip = slave.of_nodes(gaps, middle)[:, 0], slave.of_nodes(slips, middle)
        gap_range, slip_range = (slave.of_nodes(of, extent) for of in (gaps, slips))
        r_n = (force * normals).sum(axis=1)
        tangential = force - r_n[:, None] * normals
        axes, between = self._axes()
        slip = np.einsum("ni,nij->nj", slip, axes)
        r = np.column_stack(
            (np.einsum("ni,nij->nj", tangential[:, :-1], axes), r_n)
        )  # normals are close to the scene's
        stiff = np.full(len(r), self.stiff)
        gap[~some] = np.where(r_n > 0, 0.0, np.inf)[~some]
        slip[~(some & self.pressed)] = 0.0
        normal, cone, slipped = law_defects(r, gap, slip, stiff, stiff[:, None, None] * np.eye(d - 1), self.mu, self.p)  # fmt: skip
        bare = covered == 0.0
        turned = np.linalg.norm(r, axis=1) * (spread + between)
        tilted = turned * (1 + np.max(self.mu) / np.min(self.mu)) if np.any(self.mu) else turned
        allowed = turned + self.stiff * RANGE * np.where(some, gap_range, 0.0)
        over = np.where(bare, np.linalg.norm(r, axis=1), np.maximum(normal - allowed, 0))
        ranged = 2 * self.stiff * RANGE * slip_range + turned
        slipped = np.where(some & self.pressed, slipped - ranged, 0.0)
        return dict(normal=norm(over), cone=norm(np.maximum(cone - tilted, 0)), slip=norm(np.maximum(slipped, 0)))  # fmt: skip

    def _axes(self):
        """Principal friction directions of each node, columns, ``shape=(n, d - 1, d - 1)``, and radians by which they differ between its facets.

        The scene's first one is a line drawn on the slave: on each facet it turns as the points of this facet do, in their best affine map.
        """
        scene, d, slave = self.scene, self.d, self.faces[0]
        if d == 2 or scene.sliding == "small":
            return np.tile(np.eye(d - 1), (slave.nodes.size, 1, 1)), np.zeros(slave.nodes.size)
        before = slave.x.reshape(len(slave.near), slave.count, d)[:, :, :2]
        after = before + slave.moved(scene.u).reshape(*before.shape[:2], d)[:, :, :2]
        lines = [np.linalg.lstsq(x - x.mean(axis=0), y - y.mean(axis=0), rcond=None)[0][0] for x, y in zip(before, after)]  # fmt: skip
        angles = np.repeat([np.arctan2(line[1], line[0]) for line in lines], slave.count)[:, None]
        turned = slave.of_nodes(angles, lambda of: (of.max() + of.min()) / 2)
        cos, sin = np.cos(turned), np.sin(turned)
        axes = np.stack((np.stack((cos, -sin), axis=-1), np.stack((sin, cos), axis=-1)), axis=-2)
        return axes, slave.of_nodes(angles, np.ptp)

    def _moment(self, on_slave, on_master, gaps, off) -> float:
        """What is left of moments of both faces, beyond the gap between them and what else is ``off`` at nodes, over the scene's length."""
        scene, slave = self.scene, self.faces[0]
        x = self.x + (scene.u.x.array.reshape(-1, self.d) @ scene.turn if scene.sliding == "large" else 0.0)  # fmt: skip
        middle = x[slave.nodes].mean(axis=0)
        product = sum((x[face.nodes] - middle).T @ f for face, f in zip(self.faces, (on_slave, on_master)))  # fmt: skip
        left = (product - product.T)[np.triu_indices(self.d, 1)]
        gap = slave.of_nodes(gaps, lambda g: np.nanmax(np.abs(g)) if np.isfinite(g).any() else 0.0)
        if scene.sliding == "small":  # forces act across the gap of the undeformed bodies
            gap = gap + np.abs(self.x[slave.nodes, -1]) if scene.gap or scene.radius else 0.0 * gap
        allowed = (np.linalg.norm(on_slave, axis=1) * (np.ravel(gap) + off)).sum()
        return max(norm(left) - allowed, 0.0) / scene.length

    def _energy(self, left, gaps, slips, off) -> float:
        """What reported dissipation misses of the supports' work less elastic energy, over the largest motion of the step.

        Forces go straight from one state to the next.  Friction that changes on another way works by up to half of its change times the
        slip more or less, forces on the other face, where they move on, by half of theirs times its deformation; pressure works where gaps change.
        """
        scene, d = self.scene, self.d
        u, before, was = scene.u.x.array, self.before.x.array, self.left
        way, done = u - before, scene.contact.dissipation.sum()
        work = (was + left)[self.fixed] @ way[self.fixed] / 2 - (u @ left - before @ was) / 2
        missed = abs(work - (done - self.dissipated))
        force, old, way = (of.reshape(-1, d) @ scene.turn for of in (left, was, way))
        slave, master = (face.nodes for face in self.faces)
        # of what has left the other face
        beyond = way[slave].mean(axis=0) - way[master].mean(axis=0)
        opens = self._largest(gaps - self.gaps, beyond[-1]) + off
        changes = np.linalg.norm(force - old, axis=1) / 2
        bends = np.linalg.norm(way[master] - way[master].mean(axis=0), axis=1)
        presses = np.linalg.norm(force[slave], axis=1) + np.linalg.norm(old[slave], axis=1)
        allowed = changes[slave] @ self._largest(slips, beyond[:-1]) + changes[master] @ bends
        allowed += presses @ opens / 2
        self.left, self.dissipated, self.gaps = left, done, gaps
        return max(missed - allowed, 0.0) / max(np.abs(way).max(), np.finfo(float).tiny)

    def _largest(self, values, beyond):
        """Largest norm at the points of each slave node's facets; where nothing is opposite that of ``beyond``."""
        known = np.where(np.isnan(values), beyond, values)
        return self.faces[0].of_nodes(known, lambda g: np.linalg.norm(g, axis=1).max())

    def _bar(self, found, pushed: float, down: float, tol: float) -> None:
        """Two bars in series that do not widen: force by closed form."""
        scene = self.scene
        if scene.bars is None:
            return
        closed = max(down - scene.gap, 0.0)
        expected = scene.area * closed / sum(1 / k for k in scene.bars)
        if abs(pushed - expected) > BAR * tol * max(abs(pushed), expected):
            found.notes.append(f"two bars carry {pushed:g}, by closed form {expected:g}")
