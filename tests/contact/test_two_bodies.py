# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two deformable bodies whose meshes do not match: patch tests, balance, matching meshes as one body, solvers and ranks that agree."""

import warnings

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from dolfinx.mesh import locate_entities_boundary
from two_bodies import COMM, E, blocks, dc, patch

from dolfinx_contact.compat import functionspace
from mechanics.two_blocks import box, joined, pair

pytestmark = pytest.mark.ranks

SOLVERS = {
    "CondensedNewton": dc.CondensedNewton(),
    "FixedPoint": dc.FixedPoint(),
    "SparseNewton": dc.SparseNewton(),
    "SNES": dc.SNES(),
}
PATCHES = [
    ("hexahedron", 1, False, (E, E), False), ("hexahedron", 2, True, (E, E), False), ("quadrilateral", 1, True, (E, E), False),
    ("triangle", 2, False, (1e4 * E, E), True), ("tetrahedron", 2, True, (E, 10 * E), True), ("triangle", 1, True, (E, 1e4 * E), False),
    *[pytest.param(cell, degree, slips, (E, E), False, marks=pytest.mark.slow) for cell in ("hexahedron", "quadrilateral", "triangle", "tetrahedron") for degree in (1, 2) for slips in (False, True)],
]  # fmt: skip


def largest(values) -> float:
    return max(COMM.allgather(float(np.abs(values).max(initial=0.0))))


def total(values) -> np.ndarray:
    return COMM.allreduce(np.sum(values, axis=0))


@pytest.mark.parametrize("cell, degree, slips, moduli, swapped", PATCHES)
def test_an_even_stress_is_exact(cell, degree, slips, moduli, swapped):
    """On distorted meshes, turned in space, every node has the traction times its area, and displacements are linear."""
    scene = patch(cell, degree, slips, moduli, swapped=swapped)
    step = scene.problem.solve()
    assert step.error <= 1e-10
    forces = np.einsum("ni,nij->nj", scene.contact.reaction, scene.contact.frame)
    traction = scene.turn @ scene.traction * (-1.0 if swapped else 1.0)
    expected = scene.contact.area[:, None] * traction
    assert largest(forces - expected) <= 1e-9 * largest(expected)
    exact = scene.exact.x.array
    assert largest(scene.u.x.array - exact) <= 1e-9 * largest(exact)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    "cell, cells", [("hexahedron", ((3, 3, 2), (4, 4, 2))), ("triangle", ((4, 3), (7, 3)))]
)
def test_solvers_agree_and_forces_balance(cell, cells, solver):
    """Pressed and dragged obliquely, some nodes slip: every solver finds the same, and supports carry what the contact does."""
    flat = cell == "triangle"
    law = dict(mu=0.3) if flat else dict(mu=(0.3, 0.15), p=(0.05, 0.2), axis=(1, 0.2, 0))
    forces = []
    for name in ("CondensedNewton", solver):
        scene = blocks(cell, 1, cells, moduli=(E, 3 * E), solver=SOLVERS[name], **law)
        for k in range(3):
            scene.way.value[:] = [0.004 * k, -0.01] if flat else [0.004 * k, 0.002 * k, -0.01]
            step = scene.problem.solve()
        assert step.counts.slip > 0 and step.counts.stick > 0
        forces.append(np.append(scene.contact.force(), total(scene.contact.dissipation)))
        # what acts on both bodies together is in balance, node by node of each
        left = np.zeros(scene.contact.points.size)
        scene.contact.assemble_reaction(left)
        assert np.abs(total(left.reshape(-1, 2 if flat else 3))).max() <= 1e-12 * np.abs(forces[-1]).max()  # fmt: skip
    assert forces[0] == pytest.approx(forces[1], rel=1e-8, abs=1e-8 * np.abs(forces[0]).max())


@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
def test_meshes_that_match_are_one_body(swapped):
    """Perfectly rough, and nowhere open: the two halves of a column under its shear move as one, to the last digits."""
    scene = blocks("hexahedron", 1, ((2, 2, 2), (2, 2, 2)), mu=np.inf, swapped=swapped)
    scene.way.value[:] = (0.01, 0.0, -0.1)
    step = scene.problem.solve()
    assert step.counts.stick == step.counts.stick + step.counts.slip + step.counts.open
    at, here = scene.V.tabulate_dof_coordinates(), scene.u.x.array.reshape(-1, 3)
    both = {}
    for x, u in zip(at, here):
        both.setdefault(tuple(np.round(x, 9)), []).append(u)
    twice = [np.ptp(u, axis=0) for u in both.values() if len(u) > 1]
    assert COMM.allreduce(len(twice)) >= 9 or COMM.size > 1
    assert largest(np.array(twice).reshape(-1, 3)) < 1e-15


@pytest.mark.skipif(COMM.size > 1, reason="dense: one rank is enough")
def test_compliance_is_the_sum_of_both():
    """W of matching meshes is that of the upper body plus that of the lower one, each against a rigid plane."""
    scene = blocks("hexahedron", 1, ((2, 2, 2), (2, 2, 2)), solver=dc.CondensedNewton())
    contact, surface = scene.contact, scene.contact.surface
    found = []
    for facets, other in ((contact.facets, surface), (contact.facets, 1.0), (surface.facets, -1.0)):
        if other is not surface:
            other = dc.RigidPlane((0, 0, 0), (0, 0, other), axis=(1, 0, 0))
        one = dc.Contact(scene.V, facets, other, dc.Friction(0.3))
        problem = dc.ContactProblem(scene.F, scene.u, [one], bcs=scene.bcs, solver=scene.problem.solver)  # fmt: skip
        scene.way.value[:] = (0.0, 0.0, -0.01 if other is surface or other.normal[2] > 0 else 0.01)
        problem.solve()
        order = np.lexsort(np.round(one.x, 9).T)
        W = problem.bound().compliance().reshape(9, 3, 9, 3)[order][:, :, order]
        found.append(W)
    turned = np.array([1.0, -1.0, -1.0])  # the frame of the lower body's plane
    lower = found[2] * turned[:, None, None] * turned
    assert found[0] == pytest.approx(found[1] + lower, rel=1e-12, abs=1e-12 * found[0].max())


@pytest.mark.parametrize("degree", [1, 2])
def test_sliding_carries_mu_n(degree):
    """Where all slides friction is mu times the normal force, with edges that hang over as well; work is that times the way."""
    scene = blocks("quadrilateral", degree, ((4, 2), (5, 2)), mu=0.2, size=(1.0, 2.0))
    for way in (0.0, 0.05, 0.1):
        scene.way.value[:] = (way, -0.01)
        step = scene.problem.solve()
    assert step.counts.stick == 0
    along, normal = scene.contact.force()
    assert along == pytest.approx(-0.2 * normal, rel=1e-12)
    slip = scene.contact.slip_increment[:, 0]
    assert largest(slip) > 0.0
    assert (scene.contact.area > 0).all()


@pytest.mark.parametrize("along, angle", [((1, 0), 0.0), ((0, 1), np.pi / 2), pytest.param((1, 0), np.pi / 2, marks=pytest.mark.slow)])  # fmt: skip
def test_two_textures_work_as_the_mean(along, angle):
    """Where all slides, work of friction over force and way is the mean of what both sides would work."""
    laws = dc.Friction((0.3, 0.1), (0.1, 0.2)), dc.Friction((0.15, 0.25))
    scene = blocks("hexahedron", 1, ((2, 2, 1), (3, 3, 1)), size=(1.0, 2.0), axis=(1, 0, 0), sliding="large")  # fmt: skip
    scene.contact.friction = dc.Friction.of_pair(*laws, angle)
    for way in (0.0, 0.2, 0.4):
        before, pressed = scene.contact.dissipation.copy(), scene.contact.force()[2]
        scene.way.value[:] = (*np.multiply(way, along), -1e-4)
        step = scene.problem.solve()
    assert step.counts.stick == 0
    done = total(scene.contact.dissipation - before)
    force, slip = scene.contact.force(), np.array([along], dtype=float)
    turned = slip @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    works = [float((law.drag(by) * by).sum()) for law, by in zip(laws, (slip, turned))]
    assert abs(force[:2] @ along) == pytest.approx(np.mean(works) * force[2], rel=2e-3)
    assert done == pytest.approx(np.mean(works) * (pressed + force[2]) / 2 * 0.2, rel=1e-3)


def test_a_field_is_paired_by_its_values():
    """What a contact has made of a field at its nodes pairs with the other side's number: the mean of both, node by node."""
    contact = blocks("quadrilateral", 1, ((4, 2), (5, 2))).contact
    contact.friction = dc.Friction(lambda x: 0.2 + 0.1 * x[0])
    contact.friction = dc.Friction.of_pair(contact.friction, 0.1)
    assert contact.friction.mu[:, 0] == pytest.approx(0.15 + 0.05 * contact.x[:, 0], rel=1e-12)


@pytest.mark.parametrize("swapped", [False, True], ids=["upper", "lower"])
@pytest.mark.parametrize("weight", ["2 pi r", "callable", "thickness"])
def test_an_even_pressure_of_weighted_forms(weight, swapped):
    """Cylinders, and plates of a thickness, under an even pressure: nodes have it, although meshes do not match down to the axis."""
    domain, top, bottom, upper, lower, _ = pair("quadrilateral", ((4, 2), (7, 2)))
    V = functionspace(domain, ("Lagrange", 1, (2,)))
    u, v, r = fem.Function(V), ufl.TestFunction(V), ufl.SpatialCoordinate(domain)[0]
    given = {"2 pi r": 2 * ufl.pi * r, "callable": lambda x: 2 * np.pi * x[0], "thickness": 3.0}[weight]  # fmt: skip
    factor, hoop = (3.0, 0.0) if weight == "thickness" else (2 * ufl.pi * r, u[0] * v[0] / r**2)
    strain = [ufl.sym(ufl.grad(w)) for w in (u, v)]
    F = E * (ufl.inner(*strain) + hoop) * factor * ufl.dx  # Poisson's ratio is zero
    down, parts = fem.Constant(domain, 0.0), [V.sub(0), V.sub(1)]
    axis = locate_entities_boundary(domain, 1, lambda x: np.isclose(x[0], 0.0))
    held = [(0.0, axis, parts[0]), (0.0, bottom, parts[1]), (down, top, parts[1])]
    bcs = [fem.dirichletbc(value, fem.locate_dofs_topological(W, 1, facets), W) for value, facets, W in held]  # fmt: skip
    slave, master = (lower, upper) if swapped else (upper, lower)
    contact = dc.Contact(V, slave, dc.DeformableSurface(V, master), 0.0, weight=given)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, tol=1e-10)
    down.value = -2e-3
    problem.solve()
    assert contact.pressure == pytest.approx(1e-3 * E, rel=1e-9)
    assert total(contact.area) == pytest.approx(3.0 if weight == "thickness" else np.pi)


def test_sliding_too_far_is_told():
    """Sliding is small: by more than half a facet of the other side is warned of, once."""
    scene = blocks("quadrilateral", 1, ((4, 2), (5, 2)), mu=0.0, size=(1.0, 2.0))
    scene.way.value[:] = (0.15, -0.01)
    scene.problem.solve()
    for way, told in ((0.25, 1), (0.3, 0)):
        scene.way.value[0] = way
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            scene.problem.solve()
        assert len(said) == told and all("slid by" in str(one.message) for one in said)


@pytest.mark.parametrize("held, told", [("slave", 1), ("both", 0), ("master", 0)])
def test_friction_that_supports_take_is_told(held, told):
    """Of slave nodes held along the other body, where that is not held in the same plane, as on one of symmetry."""
    scene = blocks("quadrilateral", 1, ((4, 2), (6, 2)), swapped=held == "master")
    low = -1.0 if held == "both" else 0.0  # else of the upper body alone
    side = locate_entities_boundary(scene.domain, 1, lambda x: np.isclose(x[0], 0.0) & (x[1] > low - 1e-9))  # fmt: skip
    dofs = fem.locate_dofs_topological(scene.V.sub(0), 1, side)
    scene.problem.bcs = [*scene.bcs, fem.dirichletbc(0.0, dofs, scene.V.sub(0))]
    scene.way.value[1] = -0.01
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(2):
            scene.problem.solve()
    assert sum("have no friction" in str(one.message) for one in said) == told


def test_a_gap_closes_and_opens():
    """A gap between both counts: the upper body falls by it before it presses, and no force is left when it is lifted."""
    scene = blocks("hexahedron", 1, ((2, 2, 1), (3, 3, 1)), gap=0.01)
    scene.way.value[2] = -0.009
    assert scene.problem.solve().counts.open == 9
    assert scene.contact.gap == pytest.approx(0.001, rel=1e-9)
    scene.way.value[2] = -0.02
    assert scene.problem.solve().counts.open == 0
    scene.way.value[2] = -0.005
    assert scene.problem.solve().counts.open == 9
    assert not scene.contact.force().any()


def test_checkpoints_and_rewind(tmp_path):
    """A run that goes on from a file has the same bits; a step taken back and made again, too."""
    paths = [(0.0, 0.0, -0.01), (0.004, 0.0, -0.01), (0.002, 0.001, -0.012)]
    whole, parted = (blocks("hexahedron", 1, ((2, 2, 2), (3, 3, 2)), mu=(0.3, 0.1), axis=(1, 0, 0)) for _ in range(2))  # fmt: skip
    file = COMM.bcast(str(tmp_path / "state.npz"))
    for k, way in enumerate(paths):
        whole.way.value[:] = parted.way.value[:] = way
        whole.problem.solve()
        parted.problem.solve()
        if k == 1:
            parted.problem.rewind()
            parted.problem.solve()
            parted.problem.save(file)
            parted.problem.reset()
            parted.problem.load(file)
    assert largest(whole.contact.reaction - parted.contact.reaction) <= 1e-9 * largest(whole.contact.reaction)  # fmt: skip
    assert largest(whole.contact.slip_path - parted.contact.slip_path) <= 1e-12


def test_what_makes_no_sense_is_refused():
    """A deformable surface is not moved by hand; facets inside a body, or none, are no surface."""
    scene = blocks("quadrilateral", 1, ((2, 2), (3, 2)))
    with pytest.raises(ValueError, match="moves with its body"):
        scene.contact.surface.displacement = (0.0, 1.0)
    with pytest.raises(AttributeError, match="moves with its body"):
        scene.contact.surface.free = ("n",)
    with pytest.raises(ValueError, match="empty"):
        dc.DeformableSurface(scene.V, [])
    with pytest.raises(ValueError, match="slave"):
        dc.ContactProblem(
            scene.F,
            scene.u,
            [
                dc.Contact(scene.V, scene.contact.facets, dc.DeformableSurface(scene.V, scene.contact.surface.facets), 0.1),
                dc.Contact(scene.V, scene.contact.surface.facets, dc.DeformableSurface(scene.V, scene.contact.facets), 0.1),
            ],
            bcs=scene.bcs,
        )  # fmt: skip


@pytest.mark.parametrize(
    "cells, moduli, told",
    [
        (((2, 2), (7, 2)), (E, E), "3.5 times as large"),
        (((4, 2), (4, 2)), (5 * E, E), "5 times as stiff"),
        (((7, 2), (2, 2)), (5 * E, E), ""),
        (((4, 2), (4, 2)), (E, E), ""),
    ],
)
def test_the_wrong_side_is_told(cells, moduli, told, caplog):
    """The coarser or stiffer side as the one that carries the unknowns is logged once, when it presses."""
    scene = blocks("quadrilateral", 1, cells, moduli=moduli)
    with caplog.at_level("INFO", logger="dolfinx_contact"):
        for down in (0.01, -0.01, -0.02):
            scene.way.value[1] = down
            scene.problem.solve()
    lines = [line for line in caplog.messages if "carries the unknowns" in line]
    assert len(lines) == bool(told and COMM.rank == 0) and all(told in line for line in lines)


@pytest.mark.parametrize("cells", [(2, 2, 2), (5, 5, 5)])
@pytest.mark.parametrize("swapped", [False, True])
def test_a_surface_of_another_mesh_is_refused(cells, swapped):
    """Numbers of facets mean nothing in another mesh, of as many cells or of other ones: refused, naming V and what to do."""
    spaces = [
        functionspace(mesh.create_unit_cube(COMM, *n), ("Lagrange", 1, (3,))) for n in (cells, (2, 2, 2))
    ]  # fmt: skip
    facets = [locate_entities_boundary(V.mesh, 2, lambda x: np.isclose(x[2], 0)) for V in spaces]
    mine, other = (1, 0) if swapped else (0, 1)
    surface = dc.DeformableSurface(spaces[other], facets[other])
    with pytest.raises(ValueError, match="V of the DeformableSurface is a space of another mesh"):
        dc.Contact(spaces[mine], facets[mine], surface, dc.Friction(0.3))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron", "tetrahedron"])
def test_head_and_foot_of_one_body_are_no_pair(cell):
    """A gap that would close through the body is refused; faces of one body that face each other, as of a slit, are a pair."""
    d = 2 if cell in ("quadrilateral", "triangle") else 3
    block = joined([box(cell, np.zeros(d), np.ones(d), (3,) * d)])
    slit = joined([box(cell, np.zeros(d), np.ones(d), (4,) * d)])
    x = slit.geometry.x
    for domain, faces, whole in ((block, (0.0, 1.0), True), (slit, (0.0, 1.0), False)):
        if not whole:  # bent to a ring that is nearly closed: its ends face each other
            angle = 0.25 * np.pi - 1.9 * np.pi * x[:, d - 1]
            radius = 1.0 + x[:, 0]
            x[:, 0], x[:, d - 1] = radius * np.sin(angle), radius * np.cos(angle)
        V = functionspace(domain, ("Lagrange", 1, (d,)))
        u = fem.Function(V)
        ends = [np.pi * (0.25 - 1.9 * at) for at in faces]
        marks = [lambda X, at=at: np.isclose(X[d - 1], at) for at in faces] if whole else [lambda X, a=a: np.isclose(X[0] * np.cos(a) - X[d - 1] * np.sin(a), 0.0) & (X[0] * np.sin(a) + X[d - 1] * np.cos(a) > 0) for a in ends]  # fmt: skip
        foot, head = (mesh.locate_entities_boundary(domain, d - 1, mark) for mark in marks)
        contact = dc.Contact(V, foot, dc.DeformableSurface(V, head), dc.Friction(0.0))
        F = ufl.inner(u, ufl.TestFunction(V)) * ufl.dx
        if whole:
            with pytest.raises(ValueError, match="closed through the body"):
                dc.ContactProblem(F, u, [contact])
        else:
            dc.ContactProblem(F, u, [contact])
