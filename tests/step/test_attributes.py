# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What a user sets is honoured, or refused at once with what to do; what was computed cannot be changed by accident."""

import pickle
import warnings
from copy import copy

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.contact.saved import load_saved, saved_of

COMM = scenes.COMM


def pressed(*top, **options):
    """A block pressed on the plane by one step."""
    scene = scenes.block(cells=(3, 3, 2), **options)
    scene.move_top(*(top or (0.0, 0.0, -0.01)))
    scene.problem.solve()
    return scene


def close(found, expected, tol=1e-8):
    size = COMM.allreduce(np.abs(expected).max(initial=0.0), op=scenes.MPI.MAX)
    return np.abs(found - expected).max(initial=0.0) <= tol * size


@pytest.mark.parametrize("name, value", [("normal", (0, 0, 2)), ("point", (0, 0, 1)), ("axis", (0, 1, 0)), ("frame", np.eye(3))])  # fmt: skip
def test_a_plane_stays_what_it_was_made(name, value):
    """A normal, point or axis set anew would change gaps and not the frame: refused, with what to do; in place, too."""
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0))
    with pytest.raises(
        AttributeError, match=f"RigidPlane.{name} cannot be set: make a new RigidPlane"
    ):
        setattr(plane, name, value)
    if name != "frame":
        with pytest.raises(ValueError, match="read-only"):
            getattr(plane, name)[0] *= 10


@pytest.mark.parametrize("mu", [0.3, (0.3, 0.2), np.full((3, 2), 0.3)])
def test_an_entry_of_a_law_is_refused_with_what_to_do(mu):
    """A Friction is immutable, its arrays too, and the message says to assign another one; copies and what is computed are plain arrays."""
    law = dc.Friction(mu, axes=np.tile([1.0, 0.0], (3, 1)))
    for name in ("mu", "p", "axes"):
        array = getattr(law, name)
        with pytest.raises(
            ValueError, match=rf"friction.{name} is read-only, .* contact.friction = dc.Friction"
        ):
            array[...] = 0.5
        for operation in ("__iadd__", "__isub__", "__imul__"):
            with pytest.raises(
                AttributeError, match=f"Friction.{name} cannot be set: it is immutable"
            ):
                setattr(law, name, getattr(array, operation)(2.0))
        assert type(array * 2) is type(array.copy()) is np.ndarray
    again = pickle.loads(pickle.dumps(law))
    assert (again.mu == law.mu).all() and again.associated and not again.mu.flags.writeable


def test_misspelt_attributes_are_refused():
    """An attribute that nobody reads is a mistake, and the one that was meant is named."""
    scene = scenes.block(cells=(2, 2, 2))
    for thing, wrong, meant in [
        (scene.surface, "displacment", "displacement"),
        (scene.contact, "fricton", "friction"),
        (scene.contact, "presure", "pressure"),
        (scene.problem, "montor", "monitor"),
        (scene.problem, "toll", "tol"),
    ]:
        with pytest.raises(AttributeError, match=f"did you mean '{meant}'"):
            setattr(thing, wrong, 1.0)
    for thing, name in [
        (scene.contact, "reaction"),
        (scene.contact, "surface"),
        (scene.problem, "u"),
    ]:
        with pytest.raises(AttributeError, match="cannot be set: .* make a new Contact"):
            setattr(thing, name, getattr(thing, name))


RESULTS = ("displacement", "reaction", "gap", "slip_increment", "status", "dissipation", "wear_depth", "slip_path", "x", "nodes")  # fmt: skip


def test_results_are_read_only():
    """Arithmetic in place on a result would change the history of the next step: refused."""
    scene = pressed()
    for name in RESULTS:
        with pytest.raises(ValueError, match="read-only"):
            getattr(scene.contact, name)[:] = 0
    with pytest.raises(ValueError, match="read-only"):
        scene.surface.displacement[0] = 1.0
    given = np.array([0.001, 0.0, 0.0])
    scene.surface.displacement = given
    given[:] = 5.0  # the user's own array stays the user's
    assert scene.surface.displacement.tolist() == [0.001, 0.0, 0.0]


@pytest.mark.parametrize(
    "solver", [dc.CondensedNewton(), dc.FixedPoint(), dc.FixedPoint(map="bipotential")]
)
@pytest.mark.parametrize(
    "new", [dc.Friction(mu=(0.2, 0.1), p=(0.05, 0.2)), dc.Friction(mu=0.0), "per node", "axes"]
)
def test_friction_is_exchanged_between_steps(solver, new):
    """Friction exchanged after a step holds from then on, with the history: as in a problem that takes up a checkpoint's
    history under the new law."""
    first, second = (pressed(solver=solver) for _ in range(2))
    mu = np.array((0.2, 0.3)) + 0.1 * first.contact.x[:, :2]
    if new == "per node":
        new = dc.Friction(mu)
    elif new == "axes":
        new = dc.Friction((0.3, 0.15), axes=np.tile((0.6, 0.8), (len(mu), 1)))
    first.contact.friction = new
    other = scenes.block(cells=(3, 3, 2), solver=solver)
    other.contact.friction = new
    saved = saved_of(second.contact)
    left = {k: v for k, v in saved.items() if k not in ("laws", "rigid_plane")}
    load_saved(other.contact, left)
    for scene in (first, other):
        scene.move_top(0.002, 0.001, -0.01)
        record = scene.problem.solve()
        assert max(record.error, record.slip_error) <= scene.problem.tol
    assert (
        first.contact.load_function <= 1e-7 * np.abs(first.contact.reaction).max(initial=1)
    ).all()
    for name in ("reaction", "slip_increment"):
        assert close(getattr(first.contact, name), getattr(other.contact, name), 1e-6), name
    if new.mu.tolist() == [
        0.2,
        0.1,
    ]:  # the force of before says the same direction of slip under both laws
        assert close(first.contact.dissipation, other.contact.dissipation, 1e-6)
    assert COMM.allreduce(first.contact.dissipation.sum()) >= COMM.allreduce(
        (1 - 1e-12) * second.contact.dissipation.sum()
    )


def test_exchanged_friction_keeps_the_condensed_operator(monkeypatch):
    """Coefficients that change leave the compliance of the body as it is: it is computed once."""
    from dolfinx_contact.solvers.condensed import body as condensed

    made, plain = [], condensed.compliance
    monkeypatch.setattr(condensed, "compliance", lambda *args: made.append(1) or plain(*args))
    scene = pressed(solver=dc.CondensedNewton())
    for mu in (0.25, 0.2, (0.1, 0.3)):
        scene.contact.friction = dc.Friction(mu)
        scene.problem.solve()
    assert len(made) == 1
    scene.contact.friction = dc.Friction(0.0)  # fewer unknowns
    scene.problem.solve()
    assert len(made) == 2


def test_friction_that_does_not_fit_is_refused():
    """Coefficients for other nodes, or different ones on the ranks, are an error of the next step on all ranks; no law at
    all is one at once; and the history stays."""
    scene = pressed()
    u, old = scene.u.x.array.copy(), scene.contact.friction
    with pytest.raises(ValueError, match="friction must be a Friction"):
        scene.contact.friction = "0.3"
    with pytest.raises(ValueError, match="wear must be a Wear.*: 0.0001; of .* make dc.Wear"):
        scene.contact.wear = 1e-4
    rows = len(scene.contact.nodes) + (COMM.rank == 0)
    scene.contact.friction = dc.Friction(np.tile((0.3, 0.15), (rows, 1)))
    with pytest.raises(ValueError, match="friction.mu has .* rows"):
        scene.problem.solve()
    if COMM.size > 1:
        scene.contact.friction = dc.Friction(0.1 + 0.1 * COMM.rank)
        with pytest.raises(ValueError, match="differs between ranks"):
            scene.problem.solve()
    assert np.array_equal(scene.u.x.array, u)
    scene.contact.friction = old
    scene.problem.solve()


@pytest.mark.parametrize("change", ["moved", "scaled"])
@pytest.mark.parametrize("when", ["before the problem", "between steps"])
def test_a_mesh_that_moved_is_noticed(change, when):
    """Gaps and areas are those of the mesh as it was: moved or scaled since, on any rank, it is refused."""
    scene = pressed()
    x = scene.mesh.geometry.x
    if COMM.rank == COMM.size - 1:
        x[:] = 1.001 * x if change == "scaled" else x + [0, 0, 0.5]
    with pytest.raises(ValueError, match="mesh was moved or scaled"):
        if when == "between steps":
            scene.problem.solve()
        else:
            dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)


def test_an_initial_guess_is_kept():
    """What stands in u when a problem is made is the guess of its first step: from the solution none is left to do."""
    scene = pressed(solver=dc.FixedPoint())
    u = scene.u.x.array.copy()
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0))
    contact = dc.Contact(scene.V, scene.facets, plane, scene.contact.friction)
    problem = dc.ContactProblem(
        scene.F, scene.u, contact, bcs=scene.bcs, solver=dc.FixedPoint(), tol=1e-8
    )
    assert np.array_equal(scene.u.x.array, u)
    assert problem.solve().iterations <= 3


def test_a_contact_has_one_history():
    """A second problem on a contact begins its history anew: the first one says so, and does not go on with another's."""
    scene = pressed()
    with pytest.warns(UserWarning, match="begins anew"):
        second = dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=scene.bcs)
    for verb in (scene.problem.solve, scene.problem.reset):
        with pytest.raises(ValueError, match="made later"):
            verb()
    second.solve()


def test_conditions_of_another_space_are_refused():
    """A condition built on another space, even of the same mesh and element, has other degrees of freedom."""
    scene = scenes.block(cells=(2, 2, 2))
    for other in (
        functionspace(scene.mesh, ("Lagrange", 1, (3,))),
        scenes.block(cells=(2, 2, 2)).V,
    ):
        held = fem.Function(other)
        top = mesh.locate_entities_boundary(other.mesh, 2, lambda x: np.isclose(x[2], 0.6))
        bc = fem.dirichletbc(held, fem.locate_dofs_topological(other, 2, top))
        with pytest.raises(ValueError, match="condition lives on another space"):
            dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=[bc])
    sub = scene.V.sub(2)
    top = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[2], 0.6))
    part = fem.dirichletbc(0.0, fem.locate_dofs_topological(sub, 2, top), sub)
    dc.ContactProblem(scene.F, scene.u, [scene.contact], bcs=[*scene.bcs, part])


@pytest.mark.parametrize("other", ["law", "plane", "wear", "modulus", "supports"])
def test_checkpoints_of_another_law_are_refused(tmp_path, other):
    """A history belongs to its law, plane, wear and stiffness: another one is named, and what is there stays."""
    path = COMM.bcast(tmp_path, root=0) / "state.npz"
    pressed(wear=dc.Wear(1e-4)).problem.save(path)
    scene = scenes.block(cells=(3, 3, 2), wear=dc.Wear(1e-4))
    if other == "law":
        scene.contact.friction = dc.Friction((0.3, 0.16), p=(0.05, 0.2))
    elif other == "plane":
        plane = dc.RigidPlane((0, 0, -1e-3), (0, 0, 1), (1, 0, 0))
        contact = dc.Contact(
            scene.V, scene.facets, plane, scene.contact.friction, wear=dc.Wear(1e-4)
        )
        scene.problem = dc.ContactProblem(scene.F, scene.u, contact, bcs=scene.bcs)
    elif other == "wear":
        scene.contact.wear = dc.Wear(2e-4)
    elif other == "modulus":
        scene.modulus.value = 200e3
    else:
        scene.problem = dc.ContactProblem(scene.F + 1e4 * ufl.inner(scene.u, ufl.TestFunction(scene.V)) * ufl.ds, scene.u, scene.contact, bcs=scene.bcs)  # fmt: skip
    with pytest.raises(ValueError, match="checkpoint.* written with another .*[Ss]et "):
        scene.problem.load(path)
    assert not scene.u.x.array.any()


def test_nodes_held_along_the_normal_are_left_out():
    """The bottom of a block whose side is clamped, edge included: that edge is left out with one warning that says how
    many and where, and the rest has the reactions of a contact without it."""

    def build(everything):
        scene = scenes.block(cells=(3, 3, 2))
        side = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[0], -0.5))
        clamp = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(scene.V, 2, side), scene.V)
        facets = scene.facets
        if not everything:
            inside = mesh.locate_entities_boundary(
                scene.mesh, 2, lambda x: np.isclose(x[2], 0) & (x[0] > -0.3)
            )
            facets = np.intersect1d(inside, facets).astype(np.int32)
        plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), (1, 0, 0))
        scene.contact = dc.Contact(scene.V, facets, plane, dc.Friction((0.3, 0.15), p=(0.05, 0.2)))
        arguments = (scene.F, scene.u, [scene.contact], [clamp])
        return scene, arguments

    whole, arguments = build(True)
    with pytest.warns(
        UserWarning,
        match=r"4 of 16 contact nodes, between \(-0.5, -0.5, 0\) and \(-0.5, 0.5, 0\), are left out",
    ) as said:
        problems = [dc.ContactProblem(*arguments[:3], bcs=arguments[3], tol=1e-10)]
    assert len(said) == 1
    part, arguments = build(False)
    problems.append(dc.ContactProblem(*arguments[:3], bcs=arguments[3], tol=1e-10))
    for scene, problem in zip((whole, part), problems):
        for solver in (dc.FixedPoint(), dc.CondensedNewton()):
            problem.reset()
            problem.solver = solver
            scene.force.value[:] = (200.0, 0.0, -4000.0)
            record = problem.solve()
            assert record.counts.slip + record.counts.stick > 0
    (x, r), (y, s) = (scenes.gathered(scene.contact) for scene in (whole, part))
    assert not r[np.isclose(x[:, 0], -0.5)].any()
    assert np.allclose(
        r[~np.isclose(x[:, 0], -0.5)], s[~np.isclose(y[:, 0], -0.5)], atol=1e-7 * np.abs(s).max()
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # in every step: said once
        problems[0].solve()


def test_nodes_left_out_are_told_once_on_curved_surfaces():
    """Frames that follow a ball are asked anew in each step what supports hold: what was said is not said again."""
    scene = scenes.block(cells=(3, 3, 2))
    side = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[0], -0.5))
    clamp = fem.dirichletbc(np.zeros(3), fem.locate_dofs_topological(scene.V, 2, side), scene.V)
    ball = dc.RigidSphere((0, 0, -5), 5.0)
    contact = dc.Contact(scene.V, scene.facets, ball, 0.3)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        problem = dc.ContactProblem(scene.F, scene.u, [contact], bcs=[clamp])
        for k in range(1, 4):
            ball.displacement = (0.01 * k, 0, 0.001 * k)
            problem.solve()
    assert len([w for w in said if "are left out" in str(w.message)]) == 1


def test_a_copied_surface_is_driven_by_itself():
    """Forces and free motions of a copy are its own, and those of the first one stay."""
    first = dc.RigidPlane((0, 0, 0), (0, 0, 1))
    first.free, first.force = ("n",), (0.0, 0.0, 5.0)
    other = copy(first)
    other.free, other.force, other.rotation = ("n", "t1"), (1.0, 0.0, 7.0), (0.0, 0.1, 0.0)
    assert first.free == ("n",) and first.force.tolist() == [0.0, 0.0, 5.0]
    assert [motion.name for motion in other.motions] == ["t1", "n"]
    axes = [motion.axis for motion in other.motions]
    np.testing.assert_array_equal(axes, other.frame[[0, 2]])
    assert np.abs(other.frame - first.frame).max() > 0.09


@pytest.mark.parametrize("times", [np.array([]), 10**400, np.inf, np.nan, -1, "twice", [1, 2]])
def test_how_often_a_step_counts_is_one_number(times):
    """What is no finite number of zero or more is refused, and the last value stays."""
    scene = pressed()
    with pytest.raises(ValueError, match="repeats must be"):
        scene.contact.repeats = times
    assert scene.contact.repeats == 1.0


@pytest.mark.skipif(COMM.size == 1, reason="needs ranks that differ")
@pytest.mark.parametrize("name, mine, others", [("geometry_tol", 1e-6, 1e-1), ("undetermined", "refused", "nearest")])  # fmt: skip
def test_ranks_that_differ_are_told(name, mine, others):
    """What one rank has set otherwise than the others is a ValueError on all before a step, and the step is solved once it is the same."""
    scene = pressed()
    setattr(scene.problem, name, mine if COMM.rank == 0 else others)
    with pytest.raises(ValueError, match=f"{name} differs between ranks"):
        scene.problem.solve()
    setattr(scene.problem, name, others)
    scene.problem.solve()


@pytest.mark.skipif(COMM.size == 1, reason="needs ranks that differ")
def test_what_one_rank_gives_alone_is_told():
    """A snapshot that is none, a count of cycles, or a weight of one rank alone, is a ValueError on all, which go on from where they were."""
    scene = pressed()
    kept, force = scene.problem.snapshot(), scene.contact.force()
    with pytest.raises(ValueError, match="restore takes what snapshot"):
        scene.problem.restore(3 if COMM.rank == 0 else kept)
    assert np.array_equal(scene.contact.force(), force)
    scene.contact.repeats = 2.0 if COMM.rank == 0 else 3.0
    with pytest.raises(ValueError, match="repeats differs between ranks"):
        scene.problem.solve()
    scene.contact.repeats = 1.0
    scene.problem.solve()
    x, facets = ufl.SpatialCoordinate(scene.contact.V.mesh), scene.contact.facets
    with pytest.raises(ValueError, match="weight differs between ranks"):
        dc.Contact(
            scene.contact.V,
            facets,
            scene.contact.surface,
            0.3,
            weight=x[0] + 2 if COMM.rank == 0 else None,
        )
