# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Elements of second order and prisms: nodal areas, refusals, Hertz, supports, checkpoints, output; patch tests are in test_patch.py."""

from types import SimpleNamespace

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from helpers import along_face, rounded_body
from patches import CELLS, MU, NU, E, P, box, pressed
from scenes import COMM, MPI, elasticity, gathered

from dolfinx_contact.compat import cell_nodes, functionspace


@pytest.mark.parametrize(
    "cell, weights",
    [
        ("quadrilateral", {1 / 6: 2, 1 / 3: 2, 2 / 3: 3}),
        ("hexahedron", {1 / 36: 4, 2 / 36: 4, 4 / 36: 9, 8 / 36: 4, 16 / 36: 4}),
        ("tetrahedron", {1 / 6: 8, 1 / 3: 8}),
    ],
)
def test_nodal_areas(cell, weights):
    """On regular meshes areas are those of Simpson's rule; the middles of a triangle's edges share it, its vertices are no contact nodes."""
    found = pressed(cell, 2, False, False, distorted=False)
    d, cells = found.mesh.geometry.dim, CELLS[cell][1]
    unit = 1 / np.prod(cells[: d - 1])  # area of a cell's face
    areas = np.sort(np.concatenate(COMM.allgather(found.contact.area)))
    expected = np.repeat(sorted(weights), [weights[w] for w in sorted(weights)])
    assert areas == pytest.approx(unit * expected, rel=1e-12)
    assert areas.sum() == pytest.approx(1.0, rel=1e-12)


def test_a_prism_of_first_order():
    """Without Poisson's effect a block of prisms between plates has an even pressure; a node carries a third of its triangles."""
    try:  # on one rank: on several DOLFINx 0.5 does not come back from looking for facets
        domain, bottom, top = box("prism", comm=MPI.COMM_SELF)
        if len(bottom) == 0:
            raise RuntimeError("locate_entities_boundary finds none, as in 0.9")
        V = functionspace(domain, ("Lagrange", 1, (3,)))
        contact = dc.Contact(V, bottom, dc.RigidPlane((0, 0, 0), (0, 0, 1)), dc.Friction(0.3))
    except RuntimeError as refused:
        pytest.skip(f"this DOLFINx has no boundary facets of prisms: {refused}")
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, np.array([0.0, 0.0, -1e-3]))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top), V)
    dc.ContactProblem(elasticity(u, v, E, 0.0), u, contact, bcs=[bc], tol=1e-11).solve()
    x, carried = V.tabulate_dof_coordinates(), np.zeros(len(V.tabulate_dof_coordinates()))
    for cell in cell_nodes(V):
        triangle = cell[np.isclose(x[cell, 2], 0)]
        if len(triangle) == 3:
            a, b, c = x[triangle, :2]
            carried[triangle] += (
                1e-3 * E * abs((b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]) / 6
            )
    assert carried.sum() == pytest.approx(1e-3 * E, rel=1e-12)
    assert contact.reaction[:, 2] == pytest.approx(carried[contact.nodes], rel=1e-9)


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_vertices_that_penetrate_are_counted(cell):
    """What vertices of tetrahedra of second order penetrate is in the record; bricks have no such nodes."""
    domain, bottom, top = box(cell, distorted=False)
    V = functionspace(domain, ("Lagrange", 2, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    bc = fem.dirichletbc(np.array([0.0, 0.0, -1e-3]), fem.locate_dofs_topological(V, 2, top), V)
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    contact = dc.Contact(V, bottom, plane, dc.Friction(0.0))
    step = dc.ContactProblem(elasticity(u, v, E, NU), u, contact, bcs=[bc]).solve()
    nodes = fem.locate_dofs_topological(V, 2, bottom)
    vertical = u.x.array.reshape(-1, 3)[nodes, 2]
    assert step.vertex_penetration == pytest.approx(
        max(0.0, -COMM.allreduce(vertical.min(initial=0.0), op=MPI.MIN)), rel=1e-6, abs=1e-12
    )
    assert (step.vertex_penetration > 1e-6) == (cell == "tetrahedron")


def test_what_would_have_to_pull_is_refused():
    """On tetrahedra of degree 4 some integrals are negative: refused on all ranks, with what to do."""
    domain, bottom, _ = box("tetrahedron", distorted=False)
    V = functionspace(domain, ("Lagrange", 4, (3,)))
    with pytest.raises(ValueError, match="has degree 4.* would have to pull.* degree 1 or 2"):
        dc.Contact(V, bottom, dc.RigidPlane((0, 0, 0), (0, 0, 1)), dc.Friction(0.3))
    discontinuous = functionspace(domain, ("Discontinuous Lagrange", 2, (3,)))
    with pytest.raises(ValueError, match="continuous Lagrange, got"):
        dc.Contact(discontinuous, bottom, dc.RigidPlane((0, 0, 0), (0, 0, 1)), dc.Friction(0.3))


def line_contact(cells: int, crossed: bool, approach: float) -> np.ndarray:
    """A half cylinder of second order on a plane, against Hertz's pressure of the same force.

    Returns:
        Largest difference of nodal pressures within 0.8 a, what of it alternates from node to node, both over the largest
        pressure, and the error of a by the second moment.
    """
    R, A = 1000.0, 0.1
    domain, face, _ = rounded_body(R, A, 32 * A, cells, half=True, crossed=crossed, order=2)
    V = functionspace(domain, ("Lagrange", 2, (2,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    axis, far = (
        mesh.locate_entities_boundary(domain, 1, where)
        for where in (
            lambda x: np.isclose(x[0], 0),
            lambda x: np.isclose(x[:2], 32 * A).any(axis=0),
        )
    )
    held = fem.Constant(domain, np.array([0.0, -approach * A**2 / (2 * R)]))
    X = V.sub(0)
    bcs = [
        fem.dirichletbc(held, fem.locate_dofs_topological(V, 1, far), V),
        fem.dirichletbc(fem.Constant(domain, 0.0), fem.locate_dofs_topological(X, 1, axis), X),
    ]
    contact = dc.Contact(V, face, dc.RigidPlane((0, 0), (0, 1)), dc.Friction(0.0))
    dc.ContactProblem(elasticity(u, v, E, NU), u, contact, bcs=bcs, tol=1e-10).solve()
    x, force, area = along_face(contact, contact.reaction[:, 1], contact.area)
    total = 2 * force.sum()
    a = np.sqrt(
        4 * total * R * (1 - NU**2) / (np.pi * E)
    )  # [Johnson, Contact Mechanics, 1985, Section 4.2]
    largest = 2 * total / (np.pi * a)
    inside = x < 0.8 * a
    error = (force / area / largest)[inside] - np.sqrt(1 - (x[inside] / a) ** 2)
    alternating = np.abs(error[2:] - 2 * error[1:-1] + error[:-2]).max() / 4
    return np.abs([np.abs(error).max(), alternating, np.sqrt(8 * (force @ x**2) / total) / a - 1])


@pytest.mark.parametrize("crossed", [False, True], ids=["quadrilaterals", "triangles"])
def test_hertz_has_no_checkerboard(crossed):
    """Nodal pressures converge to the closed form, and so does what alternates between corners and middles."""
    coarse, fine = (
        np.mean(
            [line_contact(cells, crossed, approach) for approach in (2.6, 2.8, 3.0, 3.2, 3.4)],
            axis=0,
        )
        for cells in (8, 32)
    )  # the mean over places of the edge within a cell
    assert fine[0] < 0.01 and fine[1] < 0.005 and fine[2] < 0.005
    assert (fine < coarse / 3).all()


def uneven(solver=None, comm=COMM, degree=2, tol=1e-11):
    """A block of 27-node bricks that sticks in the middle and slips outside, its top twisted sideways."""
    domain, bottom, top = box("hexahedron", comm=comm)
    V = functionspace(domain, ("Lagrange", degree, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, np.array([0.0, 0.0, 0.0]))
    edge = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[0], 0))
    middles = np.intersect1d(
        fem.locate_dofs_topological(V, 2, edge), fem.locate_dofs_topological(V, 2, bottom)
    )
    x = V.tabulate_dof_coordinates()
    middles = middles[
        np.isclose(np.abs(x[middles, 1] - 0.5), 0.25)
    ]  # of the cells' edges on x = z = 0
    X = V.sub(1)
    dofs = (3 * middles + 1).astype(np.int32)
    bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top), V)]
    zero = fem.Constant(domain, 0.0)
    bcs.append(fem.dirichletbc(zero, dofs, X))
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0))
    contact = dc.Contact(V, bottom, plane, dc.Friction(MU, P))
    problem = dc.ContactProblem(
        elasticity(u, v, E, NU), u, contact, bcs=bcs, solver=solver, tol=tol
    )

    def press(depth, along):
        held.value[:] = 0.2 * along, along, -depth
        return problem.solve()

    return SimpleNamespace(
        problem=problem, contact=contact, press=press, middles=middles, domain=domain
    )


def test_solvers_agree_and_supports_hold():
    """Newton's method and the fixed point find the same uneven state; middles of edges that are held sideways carry no friction there."""
    states = []
    for solver in (dc.CondensedNewton(), dc.FixedPoint()):
        scene = uneven(solver)
        for step in ((0.01, 0.0), (0.012, 0.004)):
            scene.press(*step)
        states.append(gathered(scene.contact)[1])
        held = scene.contact.points.held
        assert COMM.allreduce(int(held[:, 1].sum())) == 2 and not held[:, 0].any()
        assert np.abs(scene.contact.reaction[held[:, 1], 1]).max(initial=0.0) == 0.0
        counts = scene.problem.counts()
        assert counts.stick and counts.slip
    scale = np.abs(states[0]).max()
    assert np.abs(states[0] - states[1]).max() <= 1e-8 * scale


@pytest.mark.skipif(COMM.size == 1, reason="compares several ranks with one")
def test_ranks_agree():
    """Distributed over all ranks, nodes and reactions are those of one rank alone."""
    states = []
    for comm in (COMM, MPI.COMM_SELF):
        scene = uneven(comm=comm)
        scene.press(0.01, 0.003)
        states.append(gathered(scene.contact))
    (x, r), (y, s) = states
    assert np.abs(x - y).max() <= 1e-12 and np.abs(r - s).max() <= 1e-8 * np.abs(s).max()


@pytest.mark.parametrize("shared", [False, True], ids=["same ranks", "other ranks"])
def test_checkpoint(shared, tmp_path):
    """A run that takes up a checkpoint, also one of other ranks, goes on as without interruption."""
    path = COMM.bcast(str(tmp_path / "state.npz"))
    straight = uneven()
    straight.press(0.01, 0.0)
    if shared:  # written by each rank alone, taken up by all
        alone = uneven(comm=MPI.COMM_SELF)
        alone.press(0.01, 0.0)
        if COMM.rank == 0:
            alone.problem.save(path)
        COMM.barrier()
    else:
        straight.problem.save(path)
    straight.press(0.012, 0.004)
    second = uneven()
    second.problem.load(path)
    second.press(0.012, 0.004)
    (_, expected), (_, found) = gathered(straight.contact), gathered(second.contact)
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()
    work = [COMM.allreduce(scene.contact.dissipation.sum()) for scene in (straight, second)]
    assert work[1] == pytest.approx(work[0], rel=1e-9) and work[0] > 0


def test_values_for_output():
    """Values at the contact nodes stand at them in a function of second order, and the rest is what was asked for."""
    scene = uneven()
    scene.press(0.01, 0.003)
    contact = scene.contact
    field = contact.function(contact.x[:, 0] + 2, "place", elsewhere=-1.0)
    x = field.function_space.tabulate_dof_coordinates()
    on_plane = np.isclose(x[:, 2], 0)
    assert np.allclose(field.x.array, np.where(on_plane, x[:, 0] + 2, -1.0))
    reactions = contact.reaction_function().x.array.reshape(-1, 3)[
        : contact.V.dofmap.index_map.size_local
    ]
    assert COMM.allreduce(reactions.sum(axis=0)) == pytest.approx(contact.force(), rel=1e-12)
