# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Cells divided where the error is: as accurate as asked for, at the punch's edges, with fewer cells than divided everywhere."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from helpers import hooke
from scenes import COMM

from dolfinx_contact.analysis.adapt import _largest
from dolfinx_contact.compat import functionspace, refined

EDGE = 0.25  # half width of a flat punch, of a body of width 2 and height 1
CORNERS = [np.array([-1.0, 0.0]), np.ones(2)]


def punched(domain, order, scale=1.0, mu=0.0):
    """The body on a flat frictionless punch, its top 1e-3 down; Young's modulus 1."""
    V = functionspace(domain, ("Lagrange", order, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = ufl.inner(hooke(ufl.sym(ufl.grad(u)), 1.0, 0.3), ufl.sym(ufl.grad(v))) * ufl.dx
    top, under = (mesh.locate_entities_boundary(domain, 1, lambda x, y=y: np.isclose(x[1], y * scale)) for y in (1, 0))  # fmt: skip
    middles = mesh.compute_midpoints(domain, 1, under) if under.size else np.zeros((0, 3))
    held = fem.Constant(domain, np.array([0.0, -1e-3 * scale]))
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, top), V)]
    face = under[np.abs(middles[:, 0]) < EDGE * scale]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(mu))
    return dc.ContactProblem(F, u, contact, bcs=bcs)


def solved(domain, **options):
    pair = [punched(domain, order, **options) for order in (1, 2)]
    for problem in pair:
        problem.solve()
    return pair


def rectangle(cells, kind=mesh.CellType.triangle, scale=1.0):
    return mesh.create_rectangle(COMM, [scale * x for x in CORNERS], [cells, cells // 2], kind)


@pytest.fixture(scope="module")
def force():
    """Of uniform squares of second order; edges of the punch make the error fall with the first order."""
    found = []
    for cells in (32, 64):
        problem = punched(rectangle(cells, mesh.CellType.quadrilateral), 2)
        problem.solve()
        found.append(problem.contacts[0].force()[1])
    return 2 * found[1] - found[0]


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.05, 0.01])
def test_the_force_of_a_flat_punch(accuracy, force):
    """As accurate as asked for, by a force of other meshes; not a mesh sooner, and with fewer cells than uniform ones need."""
    found = dc.adapt(solved, rectangle(8), accuracy, "normal_force")
    assert found.reached and found.error <= accuracy
    assert abs(found.value / force - 1) <= accuracy
    *before, last = found.tried
    of_first = [abs(tried.value / force - 1) for tried in found.tried]
    assert accuracy / 4 <= of_first[-1] <= 1.5 * accuracy and of_first[-2] >= accuracy / 1.5
    assert [tried.cells for tried in before] == sorted({tried.cells for tried in before})
    # uniform meshes of first order halve their error as cells get half as wide
    uniform = abs(punched_force(16) / force - 1)
    assert last.cells < 0.5 * 2 * 16 * 8 * (uniform / of_first[-1]) ** 2


def punched_force(cells):
    problem = punched(rectangle(cells), 1)
    problem.solve()
    return problem.contacts[0].force()[1]


def test_cells_are_divided_at_the_edges():
    """The smallest cells of the last mesh are at the punch's edges, the largest far from them."""
    found = dc.adapt(solved, rectangle(8), 1e-9, "normal_force", meshes=6)
    domain = found.problem.body.V.mesh
    cells = np.arange(domain.topology.index_map(2).size_local, dtype=np.int32)
    middle = mesh.compute_midpoints(domain, 2, cells)
    away = np.hypot(np.abs(middle[:, 0]) - EDGE, middle[:, 1])
    volume = fem.Function(functionspace(domain, ("DG", 0)))
    q = ufl.TestFunction(volume.function_space)
    size = fem.assemble_vector(fem.form(q * ufl.dx)).array[: cells.size]
    rows = np.concatenate(COMM.allgather(np.column_stack([away, size])))
    small, large = (rows[rows[:, 1] <= np.quantile(rows[:, 1], share), 0] for share in (0.02, 1.0))
    assert not found.reached and len(found.tried) == 6
    assert small.max() < 0.1 and np.median(large) > 2 * small.max()
    assert rows[:, 1].max() > 8 * rows[:, 1].min() and rows[:, 1].sum() == pytest.approx(2.0)


@pytest.mark.slow
def test_units_change_nothing():
    """A body 2**20 times as large is divided in the same way; with other factors DOLFINx may take another one of equally long edges."""
    found = [
        dc.adapt(lambda of, s=scale: solved(of, scale=s), rectangle(8, scale=scale), 0.05, "normal_force")
        for scale in (1.0, 2.0**20)
    ]  # fmt: skip
    assert found[0].tried[-1].cells == found[1].tried[-1].cells
    assert found[0].value * 2.0**20 == pytest.approx(found[1].value, rel=1e-8)


def test_smallest_set_of_cells():
    """Chosen cells have the part asked for of the squares' sum, and without the least of them they do not."""
    space = functionspace(rectangle(8), ("DG", 0))
    cells = fem.Function(space)
    own = space.mesh.topology.index_map(2).size_local
    cells.x.array[:own] = np.random.default_rng(COMM.rank).exponential(size=own)
    whole = COMM.allreduce(float((cells.x.array[:own] ** 2).sum()))
    for share in (1e-9, 0.3, 0.5, 0.99):
        chosen = cells.x.array[_largest(cells, share)]
        part = COMM.allreduce(float((chosen**2).sum()))
        least = min(COMM.allgather(chosen.min(initial=np.inf)))
        assert part >= share * whole * (1 - 1e-12) and part - least**2 < share * whole
    cells.x.array[:] = 0.0
    assert _largest(cells, 0.5).size == 0


@pytest.mark.parametrize("dim", [2, 3])
def test_dividing_keeps_the_body(dim):
    """Cells that are divided fill the same volume; the others are hardly touched; dividing none changes nothing."""
    domain = rectangle(8) if dim == 2 else mesh.create_unit_cube(COMM, 4, 4, 4)
    first = np.arange(
        min(COMM.rank == 0, domain.topology.index_map(dim).size_local), dtype=np.int32
    )
    finer = refined(domain, first)
    volumes = [COMM.allreduce(fem.assemble_scalar(fem.form(fem.Constant(of, 1.0) * ufl.dx))) for of in (domain, finer)]  # fmt: skip
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-13)
    counts = [of.topology.index_map(dim).size_global for of in (domain, finer)]
    assert counts[0] < counts[1] < 2 * counts[0]


def test_what_cannot_be_meant():
    """Cells, quantity, share, accuracy and what compute returns are checked, on all ranks."""
    triangles = rectangle(4)
    for of, accuracy, quantity, options, says in (
        (rectangle(4, mesh.CellType.quadrilateral), 0.1, "normal_force", {}, "triangles or tetrahedra"),
        (triangles, 0.0, "normal_force", {}, "accuracy must be a positive"),
        (triangles, 0.1, "force", {}, "one of .*normal_force.*, got 'force'"),
        (triangles, 0.1, "normal_force", {"share": 1.5}, "share must be between 0 and 1"),
        (triangles, 0.1, "normal_force", {"meshes": 0}, "meshes must be at least 1"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=says):
            dc.adapt(solved, of, accuracy, quantity, **options)
    other = solved(rectangle(8))
    with pytest.raises(ValueError, match="on the mesh that it is given"):
        dc.adapt(lambda _: other, triangles, 0.1, "normal_force")
