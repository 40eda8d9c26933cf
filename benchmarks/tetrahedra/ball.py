"""A ball on a flat, pressed and dragged, against the closed forms of H. Hertz and R. D. Mindlin. One rank."""

from __future__ import annotations

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import second_order
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from dolfinx_contact.problem_input import body_of

# isort: split
import numpy as np
from dolfinx import fem, mesh
from helpers import elastic, point_force_field
from mpi4py import MPI

from benchmarks.tetrahedra.bodies import Body, Touching
from benchmarks.tetrahedra.points import contact_points, even, reference_values

DOWN = np.diag([1.0, 1.0, -1.0])  # frame of a body below its surface
R = 100.0  # radius of the ball; the body has E = 1, nu = 0
FRICTION, SHARE = 0.3, 0.6  # coefficient, share of all friction that drags the ball
RADII = (0.9, 1.0, 1.1)  # of the contact, for which its meshes are made


def quarter(cells: int, round: bool, order: int):
    """A quarter of a block below z = 0, fine at the origin; ``round``: its top falls off like a ball, and the cells are curved in
    second order. The mesh; facets of its top that may touch, of x = 0, y = 0, and far away."""
    domain = mesh.create_unit_cube(MPI.COMM_WORLD, cells, cells, cells, mesh.CellType.tetrahedron)
    domain = second_order(domain) if order == 2 else domain
    places = (lambda x: np.isclose(x[2], 0), lambda x: np.isclose(x[0], 0), lambda x: np.isclose(x[1], 0),
              lambda x: np.isclose(x.max(axis=0), 1))  # fmt: skip
    top, *sides = (mesh.locate_entities_boundary(domain, 2, place) for place in places)
    x, size, n = domain.geometry.x, 8.0, 2.8
    lines = np.linspace(0, 1, order * cells + 1)
    widths = size * np.sinh(n * lines) / np.sinh(n)
    near = np.interp(mesh.compute_midpoints(domain, 2, top), lines, widths).max(axis=1) < 1.6
    x[:] = np.interp(x, lines, widths) * (1, 1, -1)
    if round:
        x[:, 2] -= (1 + x[:, 2] / size) * (x[:, :2] ** 2).sum(axis=1) / (2 * R)
    return domain, top[near], *sides


def along_field(x, force: float, E: float, nu: float):
    """Displacement of a half space z < 0 under a force along x at the origin [K. L. Johnson, Contact Mechanics, 1985, Eq. (3.75)]."""
    z, rho = -x[2], np.maximum(np.linalg.norm(x, axis=0), 1e-12)
    s, b = (1 - 2 * nu) / (rho + z), force * (1 + nu) / (2 * np.pi * E)
    ux = 1 / rho + x[0] ** 2 / rho**3 + s * (1 - x[0] ** 2 / (rho * (rho + z)))
    uy = x[0] * x[1] * (1 / rho**3 - s / (rho * (rho + z)))
    return b * np.array([ux, uy, -x[0] * (z / rho**3 + s / rho)])


class Ball:
    """A rigid ball on that quarter, or its round body on a rigid plane; and the same material moved sideways.

    Far away the body moves as a half space under a force. Compliances along the plane are those of the antisymmetric quarter. Nothing
    couples them to those along the normal, as between two bodies of the same kind: then, with nu = 0, closed forms are exact.
    """

    def __init__(self, cells: int, round: bool = False, order: int = 1):
        domain, top, left, front, far = quarter(cells, round, order)
        down = [(0, left), (1, front)], point_force_field
        aside = [(1, left), (2, left), (1, front)], along_field
        normal, tangential = (self._body(domain, top, far, *how) for how in (down, aside))
        self.X, self.T, self.unknowns = normal.X, normal.T, normal.unknowns
        self.rho2 = (self.X[:, :2] ** 2).sum(axis=1)
        self.gap = -self.X[:, 2] if round else self.rho2 / (2 * R)
        t, n = (np.flatnonzero((np.arange(3 * len(self.X)) % 3 == 2) == k) for k in (0, 1))
        self.S = np.zeros_like(normal.S)
        for own, of in ((n, normal), (t, tangential)):
            self.S[np.ix_(own, own)] = of.S[np.ix_(own, own)]
        self.free = np.column_stack((tangential.free()[:, :2], normal.free()[:, 2]))

    @staticmethod
    def _body(domain, top, far, held, field) -> Body:
        V, u, F = elastic(domain, 1.0, 0.0, 2)
        moved, zero = fem.Function(V), fem.Constant(domain, 0.0)
        moved.interpolate(lambda x: field(x, 1.0, 1.0, 0.0))
        bcs = [fem.dirichletbc(moved, fem.locate_dofs_topological(V, 2, far))]
        for k, facets in held:
            dofs = fem.locate_dofs_topological(V.sub(k), 2, facets)
            bcs.append(fem.dirichletbc(zero, dofs, V.sub(k)))
        return Body(body_of(F, u, bcs, options=DIRECT_OPTIONS), top, DOWN)

    def drag(self, touching: Touching, a: float) -> dict:
        """Pressed until the radius of contact is ``a``, and dragged: errors against H. Hertz, and R. D. Mindlin."""
        points, delta, p0 = touching.points, a**2 / R, 2 * a / (np.pi * R)
        force = 4 / 3 * np.sqrt(R) * delta**1.5
        q = self.free * (SHARE * FRICTION * force, SHARE * FRICTION * force, force)
        q[:, 0] -= 3 * FRICTION * force / (4 * a) * (1 - (1 - SHARE) ** (2 / 3))
        q[:, 2] += self.gap - delta
        found = touching.solve(q, dc.Friction(FRICTION))
        t, _, n = found.forces.T
        drawn, moment = t.sum() / n.sum() / FRICTION, (t @ self.rho2) / (n @ self.rho2) / FRICTION
        gaps = (found.motion[self.T][:, :, 2] @ reference_values().T).min()
        real = points.area > 0.01 * points.area.max()
        x, r = points.x[real], found.reaction[real] / (p0 * points.area[real, None])
        middles = np.unique(self.T[:, 3:])
        common = found.forces[middles] / (p0 * even(self.X, self.T)[middles, None])
        pressures = _errors(r, x, a) | dict(common_p=_errors(common, self.X[middles], a)["p"])
        return pressures | dict(
            force=4 * n.sum() / force - 1, radius=np.sqrt(2.5 * (n @ self.rho2) / n.sum()) / a - 1,
            peak=r[:, 2].max() - 1, depth=max(-gaps, 0.0) / delta, vertices=1 - r[:, 2] @ points.area[real] * p0 / n.sum(),
            drag=4 * t.sum() / (SHARE * FRICTION * force) - 1,
            stick=max(1 - moment, 0) ** 0.2 / (1 - drawn) ** (1 / 3) - 1, seconds=found.seconds, failed=found.failed,
        )  # fmt: skip


def _errors(r: np.ndarray, x: np.ndarray, a: float) -> dict:
    """Root mean square errors within 0.8 a, of pressure and friction over their largest and over ``FRICTION`` times that; *rough*: what
    the nearest polynomial of second order leaves of them, which is what alternates."""
    at = np.linalg.norm(x[:, :2], axis=1) / a
    inner, c = at < 0.8, (1 - SHARE) ** (1 / 3)
    x, y = x[inner, :2].T / a
    smooth = np.column_stack((np.ones_like(x), x, y, x * x, x * y, y * y))
    closed = np.sqrt(1 - at[inner] ** 2)
    missing = {
        "p": r[inner, 2] - closed,
        "q": r[inner, 0] / FRICTION - closed + np.sqrt(np.maximum(c**2 - at[inner] ** 2, 0)),
    }
    found = {}
    for name, miss in missing.items():
        rest = miss - smooth @ np.linalg.lstsq(smooth, miss, rcond=None)[0]
        found[name], found[f"rough_{name}"] = (np.sqrt(np.mean(e**2)) for e in (miss, rest))
    return found


def ball(variant: str, of: Ball) -> dict:
    """Means of the errors' sizes over the radii of contact."""
    touching = Touching(contact_points(variant, of.X, of.T), of.S)
    found = [of.drag(touching, a) for a in RADII]
    means = {key: float(np.mean([abs(each[key]) for each in found])) for key in found[0]}
    return dict(scene="ball", unknowns=of.unknowns, points=len(touching.points.area)) | means
