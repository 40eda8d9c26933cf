# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Every mistake of a user is a ValueError that says what is wrong, raised by all ranks together.

A test that hangs here means that one rank raised and another waits for it.
"""

from copy import deepcopy

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
FRICTION = dc.Friction(mu=0.3)


@pytest.fixture(scope="module")
def scene():
    return scenes.block()


def plane(**changes):
    return dc.RigidPlane(**{"point": (0, 0, 0), "normal": (0, 0, 1), "axis": (1, 0, 0), **changes})


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"normal": (0, 0, 0)}, "normal must not be zero"),
        ({"normal": (0, np.nan, 1)}, "normal must be finite"),
        ({"normal": (0, 1)}, "normal must be a vector of 3"),
        ({"normal": (0, 0, 1, 0)}, "normal must be a vector of 3"),
        ({"normal": 1.0}, "normal must be a vector of 3"),
        ({"normal": (0, 0, 1j)}, "normal must be a vector of 3 real"),
        ({"normal": "up"}, "normal must be a vector"),
        ({"normal": ((0, 1), 2)}, "normal must be a vector"),
        ({"point": (0, 0, np.inf)}, "point must be finite"),
        ({"point": (0,)}, "point must be a vector of 2 or 3"),
        ({"axis": (0, 0, 0)}, "axis must not be zero"),
        ({"axis": (1, 0)}, "axis must be a vector of 3"),
        ({"axis": (0, 0, -2.0)}, "parallel to the normal"),
        ({"normal": (1, 1, 1), "axis": (1e9, 1e9, 1e9)}, "parallel to the normal"),
    ],
)
def test_plane_refuses(changes, message):
    """A plane without a direction, or with a wrong one, names the argument and its value."""
    with pytest.raises(ValueError, match=message):
        plane(**changes)


@pytest.mark.parametrize("name", ["displacement", "rotation", "force", "moment", "drive", "guides"])
@pytest.mark.parametrize("d", [2, 3])
def test_a_component_of_what_is_assigned_as_a_whole_is_refused(d, name):
    """The message says how to do it; adding to all works, copies and what is computed are arrays like any other."""
    surface = dc.RigidSphere(np.zeros(d), 1.0)
    size = 1 if d == 2 and name in ("rotation", "moment") else d
    given = np.eye(d) if name == "guides" else np.arange(1.0, 1.0 + size)
    setattr(surface, name, given)
    with pytest.raises(ValueError, match=f"surface.{name} is read-only, it is assigned as a whole"):
        getattr(surface, name)[0] = 2.0
    before = getattr(surface, name)
    assert (before == given).all() and type(before + 1) is type(before.copy()) is np.ndarray
    for taken in (before.copy(), deepcopy(before), np.array(before)):
        taken[0] = 7.0
    if name != "guides":
        other = deepcopy(surface)
        setattr(other, name, getattr(other, name) + given)
        assert getattr(other, name) == pytest.approx(2 * given)
    surface.displacement += np.ones(d)
    surface.displacement -= 0.5 * np.ones(d)
    start = given if name == "displacement" else np.zeros(d)
    assert surface.displacement == pytest.approx(start + 0.5)


@pytest.mark.parametrize("value", [(0, 0), (0, 0, np.nan), "far", (0, 0, 1j)])
def test_plane_refuses_displacement(value):
    """The plane's displacement is a finite vector of the plane's dimension."""
    with pytest.raises(ValueError, match="surface.displacement"):
        plane().displacement = value


def bad_facets(scene, case):
    cells = scene.mesh.topology.index_map(3)
    facets = scene.mesh.topology.index_map(2)
    available = facets.size_local + facets.num_ghosts
    inner = np.setdiff1d(
        np.arange(facets.size_local), mesh.exterior_facet_indices(scene.mesh.topology)
    )
    return {
        "inside": inner,
        "floats": scene.facets.astype(float),
        "matrix": scene.facets.reshape(1, -1),
        "negative": np.array([-1]),
        "out of range": np.array([available]),
        "of the wrong dimension": np.arange(cells.size_local + facets.size_local, dtype=np.int32),
        "none": np.zeros(0, dtype=np.int32),
        "strings": np.array(["bottom"]),
        "a mask": np.ones(available, dtype=bool),
        "a tag": 3,
        "tags": mesh.meshtags(scene.mesh, 2, inner, np.zeros(inner.size, dtype=np.int32)),
    }[case]


@pytest.mark.parametrize(
    "case, message",
    [
        ("inside", "not on the boundary"),
        ("floats", "array of integers"),
        ("matrix", "one-dimensional"),
        ("negative", "local indices"),
        ("out of range", "local indices"),
        ("of the wrong dimension", "local indices|not on the boundary"),
        ("none", "empty on all ranks.*facet_tags.values"),
        ("a tag", r"the number 3: pass facet_tags.find\(tag\)"),
        ("tags", r"pass facet_tags.find\(tag\)"),
        ("strings", "array of integers"),
        ("a mask", "array of integers"),
    ],
)
def test_contact_refuses_facets(scene, case, message):
    """Facets are local indices of boundary facets, at least one on some rank."""
    with pytest.raises(ValueError, match=message):
        dc.Contact(scene.V, bad_facets(scene, case), plane(), FRICTION)


def tagged(domain):
    """Tags of the lower facets of a block, 3 for negative and 8 for positive x, as on some ranks only."""
    parts = [
        mesh.locate_entities_boundary(domain, 2, lambda x, s=s: np.isclose(x[2], 0) & (s * x[0] > -1e-9))
        for s in (-1, 1)
    ]  # fmt: skip
    facets = np.concatenate(parts).astype(np.int32)
    order, tags = np.argsort(facets), np.repeat(np.int32([3, 8]), [len(part) for part in parts])
    return mesh.meshtags(domain, 2, facets[order], tags[order])


def test_facets_are_named_by_their_tags(scene):
    """By one tag or several a contact has the facets that have them, the same as by their indices."""
    facet_tags, law = tagged(scene.mesh), (plane(), FRICTION)
    for tag, wanted in [(3, [3]), (np.int32(8), [8]), ([8, 3], [3, 8]), ((3, 3), [3])]:
        contact = dc.Contact(scene.V, (facet_tags, tag), *law)
        facets = facet_tags.indices[np.isin(facet_tags.values, wanted)]
        other = dc.Contact(scene.V, facets, *law)
        assert np.array_equal(contact.nodes, other.nodes)
    both = [COMM.allreduce(dc.Contact(scene.V, (facet_tags, tag), *law).nodes.size) for tag in (3, (3, 8))]  # fmt: skip
    assert 0 < both[0] < both[1] == COMM.allreduce(scene.contact.nodes.size)


def test_tags_that_name_no_facets_are_refused(scene):
    """A tag that no facet has, on any rank, one that is none, and tags of other entities or of another mesh."""
    facet_tags, other = tagged(scene.mesh), tagged(scenes.block().mesh)
    cells = mesh.meshtags(scene.mesh, 3, np.int32([0]), np.int32([3]))
    for facets, message in [
        ((facet_tags, 5), r"no facets with the tag \[5\]: there are \[3, 8\]"),
        ((facet_tags, (3, 4, 7)), r"no facets with the tag \[4, 7\]"),
        ((facet_tags, 3.0), "tag must be an integer or several, got 3.0"),
        ((facet_tags, ()), "tag must be an integer or several"),
        ((facet_tags, None), "tag must be an integer or several, got None"),
        ((cells, 3), "of dimension 2: got tags of dimension 3"),
        ((other, 3), "of another mesh"),
    ]:
        with pytest.raises(ValueError, match=message):
            dc.Contact(scene.V, facets, plane(), FRICTION)


def test_one_rank_is_enough_to_refuse(scene):
    """A mistake on the last rank alone is raised on every rank."""
    last = COMM.rank == COMM.size - 1
    facets = np.array([-1]) if last else scene.facets
    with pytest.raises(ValueError, match="local indices"):
        dc.Contact(scene.V, facets, plane(), FRICTION)


def test_planes_that_differ_between_ranks_are_refused(scene):
    """Plane and friction must be the same on all ranks, and a difference is noticed."""
    if COMM.size == 1:
        pytest.skip("needs more than one rank")
    with pytest.raises(ValueError, match="differs between ranks"):
        dc.Contact(scene.V, scene.facets, plane(point=(0, 0, COMM.rank)), FRICTION)
    with pytest.raises(ValueError, match="differs between ranks"):
        dc.Contact(scene.V, scene.facets, plane(), dc.Friction(mu=0.1 * (1 + COMM.rank)))


@pytest.mark.parametrize("name", ["mu", "p", "axes"])
@pytest.mark.parametrize("change", [1, -1, "none"])
def test_coefficients_for_other_nodes_are_refused(scene, name, change):
    """Coefficients per node are those of a rank's own contact nodes: a row too many or too few, or no
    row, on one rank is an error on all."""
    counts = COMM.allgather(len(scene.contact.nodes))
    rows = counts[COMM.rank]
    if COMM.rank == int(np.argmax(counts)):
        rows = 0 if change == "none" else rows + change
    field = np.tile([0.6, 0.8], (rows, 1))
    friction = dc.Friction(**{"mu": (0.3, 0.15), name: field})
    with pytest.raises(ValueError, match=r"friction\.\w+ has \d+ rows"):
        dc.Contact(scene.V, scene.facets, plane(), friction)


def test_coefficients_per_node_on_some_ranks_only_are_refused(scene):
    """Coefficients are per node on all ranks or on none, whichever rank is the exception; and what is
    not per node is compared all the same."""
    if COMM.size == 1:
        pytest.skip("needs more than one rank")
    field = dc.Friction(np.tile([0.3, 0.15], (len(scene.contact.nodes), 1)))
    for exception in (0, COMM.size - 1):
        friction = dc.Friction((0.3, 0.15)) if COMM.rank == exception else field
        with pytest.raises(ValueError, match="differs between ranks"):
            dc.Contact(scene.V, scene.facets, plane(), friction)
    with pytest.raises(ValueError, match="differs between ranks"):
        dc.Contact(scene.V, scene.facets, plane(point=(0, 0, COMM.rank)), field)


def test_plane_that_moves_differently_between_ranks_is_refused():
    """A displacement set on one rank only is noticed before it becomes a result."""
    if COMM.size == 1:
        pytest.skip("needs more than one rank")
    scene = scenes.block(cells=(2, 2, 2))
    scene.surface.displacement = (0, 0, 0.01 * COMM.rank)
    with pytest.raises(ValueError, match="differs between ranks"):
        scene.problem.solve()


def test_no_facets_on_one_rank_is_fine(scene):
    """Contact may lie on some ranks only: the nodes are those of all ranks' facets."""
    everything = dc.Contact(scene.V, scene.facets, plane(), FRICTION)
    few = scene.facets if COMM.rank == 0 else scene.facets[:0]
    some = COMM.allreduce(len(few)) > 0
    if not some:
        pytest.skip("rank 0 has no contact facets in this partition")
    part = dc.Contact(scene.V, few, plane(), FRICTION)
    assert 0 < COMM.allreduce(part.nodes.size) <= COMM.allreduce(everything.nodes.size)


@pytest.mark.parametrize(
    "element, message",
    [
        (("Lagrange", 1), "component"),
        (("DG", 1, (3,)), "continuous Lagrange, got"),
        (("Lagrange", 1, (2,)), "component"),
    ],
)
def test_contact_refuses_spaces(scene, element, message):
    """Displacements are continuous Lagrange vectors of the mesh's dimension."""
    V = functionspace(scene.mesh, element)
    with pytest.raises(ValueError, match=message):
        dc.Contact(V, scene.facets, plane(), FRICTION)


def test_contact_refuses_wrong_types(scene):
    """Space, plane and friction are told apart by name."""
    for arguments, message in [
        (("V", scene.facets, plane(), FRICTION), "V must be"),
        ((scene.V, scene.facets, (0, 0, 1), FRICTION), "plane must be a RigidPlane"),
        ((scene.V, scene.facets, plane(), "0.3"), "friction must be a Friction or a number"),
        ((scene.V, scene.facets, plane(), True), "friction must be a Friction or a number"),
        ((scene.V, scene.facets, plane(), -0.3), "mu must not be negative"),
        ((scene.V, scene.facets, dc.RigidPlane((0, 0), (0, 1)), FRICTION), "dimensions"),
    ]:
        with pytest.raises(ValueError, match=message):
            dc.Contact(*arguments)


def test_a_number_is_isotropic_friction(scene):
    """Wherever a law is taken: by a contact, exchanged, by the condensed solver and the certificate."""
    contact = dc.Contact(scene.V, scene.facets, plane(), 0.3)
    assert repr(contact.friction) == repr(dc.Friction(0.3))
    contact.friction = np.float64(0.1)
    assert repr(contact.friction) == repr(dc.Friction(0.1))
    W, q = np.eye(3), np.array([0.05, 0.0, -1.0])
    with_number, with_law = (dc.solve_condensed(W, q, law) for law in (0.02, dc.Friction(0.02)))
    assert with_number.reaction == pytest.approx(with_law.reaction)
    assert dc.law.bipotential_gap([[0.3, 0, 1]], [0], [[-0.01, 0]], 0.3) == pytest.approx([0.0])


def test_friction_in_per_cent_is_told(scene):
    """30 is hardly a coefficient; what is, and what is meant to stick whatever comes, is not spoken of."""
    for mu in (0.0, 1.5, 5.0, 1e3, 1e10):
        contact = dc.Contact(scene.V, scene.facets, plane(), mu)
    with pytest.warns(UserWarning, match="a coefficient of friction of 30: it is force over force"):
        dc.Contact(scene.V, scene.facets, plane(), dc.Friction((30.0, 0.3)))
    rows = np.full((len(contact.nodes), 2), 30.0)
    for law in (30, dc.Friction(rows), dc.Friction(lambda x: 30 + 0 * x[0])):
        if len(rows) or law == 30:  # a rank without nodes has no coefficients
            with pytest.warns(UserWarning, match="a coefficient of friction of 30"):
                contact.friction = law
        else:
            contact.friction = law


def test_orthotropic_friction_needs_an_axis(scene):
    """Without an axis an orthotropic law has no directions; an isotropic one needs none."""
    bare = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1))
    with pytest.raises(ValueError, match="axis"):
        dc.Contact(scene.V, scene.facets, bare, dc.Friction(mu=(0.3, 0.15)))
    with pytest.raises(ValueError, match="axis"):
        dc.Contact(scene.V, scene.facets, bare, dc.Friction(mu=0.3, p=(1.0, 2.0)))
    dc.Contact(scene.V, scene.facets, bare, FRICTION)


def rebuilt(scene, **changes):
    scene.contact.reset()  # no history that would end here
    arguments = {
        "F": scene.F,
        "u": scene.u,
        "contacts": [scene.contact],
        "bcs": scene.bcs,
        **changes,
    }
    return dc.ContactProblem(**arguments)


@pytest.mark.parametrize("tol", [0.0, -1e-8, np.nan, np.inf, 1e-14, "small", None])
def test_problem_refuses_tolerances(scene, tol):
    """tol is a finite number that rounding allows to reach."""
    with pytest.raises(ValueError, match="tol must be"):
        rebuilt(scene, tol=tol)


def test_problem_refuses_unknown_solvers(scene):
    """A solver is an object of the library, not a word."""
    with pytest.raises(ValueError, match="solver 'magic' is unknown"):
        rebuilt(scene, solver="magic")


def test_problem_refuses_a_contact_twice(scene):
    """A contact is named once; another one on the same nodes is fine."""
    with pytest.raises(ValueError, match="same Contact twice"):
        rebuilt(scene, contacts=[scene.contact, scene.contact])


def test_problem_refuses_spaces_of_another_mesh(scene):
    """Contacts, F and u belong together."""
    other = scenes.block()
    with pytest.raises(ValueError, match="another space or mesh"):
        rebuilt(scene, contacts=[other.contact])
    with pytest.raises(ValueError, match="another space"):
        rebuilt(scene, F=other.F)
    with pytest.raises(ValueError, match="u must be a DOLFINx Function"):
        rebuilt(scene, u=scene.V)
    with pytest.raises(ValueError, match="dc.Contact"):
        rebuilt(scene, contacts=["contact"])


def test_problem_refuses_other_forms(scene):
    """F is the residual form of the unknown u."""
    v, du = ufl.TestFunction(scene.V), ufl.TrialFunction(scene.V)
    with pytest.raises(ValueError, match="one test function"):
        rebuilt(scene, F=scenes.elasticity(du, v, 1.0, 0.3))
    with pytest.raises(ValueError, match="F must be a residual form"):
        rebuilt(scene, F=0.0)
    with pytest.raises(ValueError, match="does not depend on u"):
        rebuilt(scene, F=ufl.inner(scene.force, v) * ufl.dx)


def test_problem_refuses_conditions_on_contact_nodes(scene):
    """A fixed normal displacement contradicts contact; a fixed tangential one leaves the cone."""
    normal, tangential = (
        fem.dirichletbc(0.0, fem.locate_dofs_topological(V, 2, scene.facets), V)
        for V in (scene.V.sub(2), scene.V.sub(0))
    )
    with pytest.raises(ValueError, match="boundary condition"):
        rebuilt(scene, bcs=[*scene.bcs, normal])
    rebuilt(scene, bcs=[*scene.bcs, tangential])
    assert scene.contact.points.held[:, 0].all() and not scene.contact.points.held[:, 1].any()
    rebuilt(scene, bcs=scene.bcs)
    assert not scene.contact.points.held.any()


@pytest.mark.parametrize("held", ["nothing", "one point", "height only", "a hinge", "its top"])
def test_body_that_nothing_holds_is_refused(scene, held):
    """Rigid motions that the boundary conditions leave free are found, though a factorisation works."""
    bcs = []
    if held == "its top":
        bcs = scene.bcs
    elif held == "height only":
        sub = scene.V.sub(2)
        top = mesh.locate_entities_boundary(scene.mesh, 2, lambda x: np.isclose(x[2], 0.6))
        bcs = [fem.dirichletbc(0.0, fem.locate_dofs_topological(sub, 2, top), sub)]
    elif held != "nothing":
        points = {
            "one point": lambda x: np.isclose(x[0] + x[1], 1.0) & np.isclose(x[2], 0.6),
            "a hinge": lambda x: np.isclose(x[0], 0.5) & np.isclose(x[2], 0.6),
        }[held]
        dofs = fem.locate_dofs_geometrical(scene.V, points)
        bcs = [fem.dirichletbc(np.zeros(3), dofs, scene.V)]
    problem = rebuilt(scene, bcs=bcs)
    if held == "its top":
        problem.solve()
    else:
        with pytest.raises(ValueError, match="nothing holds the body"):
            problem.solve()


def test_a_soft_spring_holds_a_body(scene):
    """A body on a spring 1e-8 as stiff as itself is held, and not refused."""
    v = ufl.TestFunction(scene.V)
    problem = rebuilt(scene, F=scene.F + 1e-8 * 210e3 * ufl.inner(scene.u, v) * ufl.ds, bcs=[])
    assert problem.solve().iterations == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("place", ["load", "boundary value", "guess", "material"])
def test_nothing_that_is_not_finite_becomes_a_result(place, bad):
    """NaN or infinity anywhere in the input is a ValueError, and the last state stays usable."""
    scene = scenes.block(cells=(2, 2, 2))
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    u, reaction = scene.u.x.array.copy(), scene.contact.reaction.copy()
    scene.move_top(0, 0, -0.02)
    if place == "load":
        scene.force.value[0] = bad
    elif place == "boundary value":
        scene.held.x.array[:] = bad
    elif place == "guess":
        scene.u.x.array[:] = bad
    else:
        scene.modulus.value = bad
    with pytest.raises(ValueError, match="NaN or infinity"):
        scene.problem.solve()
    assert np.array_equal(scene.u.x.array, u)
    assert np.array_equal(scene.contact.reaction, reaction)
    scene.force.value[0], scene.modulus.value = 0.0, 210e3
    scene.move_top(0, 0, -0.02)
    assert scene.problem.solve().error <= 1e-10


def test_a_law_of_wear_that_is_refused_leaves_the_one_before():
    """A field with negative values is a mistake: the contact keeps its law of wear, and a step wears as with it."""
    found = []
    for mistaken in (False, True):
        scene = scenes.block(cells=(2, 2, 2), mu=0.3, p=None)
        scene.contact.wear = law = dc.Wear(lambda x: 1e-7 + 0 * x[0])
        if mistaken:
            with pytest.raises(ValueError, match="must be >= 0"):
                scene.contact.wear = dc.Wear(lambda x: -1.0 + 0 * x[0])
        assert scene.contact.wear is law
        for way in (0.0, 0.01):
            scene.move_top(way, 0, -0.01)
            scene.problem.solve()
        found.append(np.sum(scene.contact.worn_volume()))
    assert found[0] == found[1] > 0.0
