# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Small scenes of every kind, each a generator: it sets the loads of a step and yields the problem, which the caller solves.

Options are those of the problem: ``solver``, ``tol``, ``geometry_tol``.
"""

import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import mixed_scenes
import nonlinear_scenes
import numpy as np
import scenes
import ufl
from dolfinx import fem, mesh
from scenes import COMM, elasticity
from two_bodies import blocks, rubber
from way_scenes import ring, slab

from dolfinx_contact.compat import functionspace
from mechanics.corners import Push, build_corner

E = 210e3  # of blocks
LAW = dict(mu=(0.3, 0.15), p=(0.05, 0.2))  # case C of the punch
EVEN = dict(mu=0.3, p=None)
ALL = ("FixedPoint", "CondensedNewton", "SparseNewton")
KINDS = {2: "quadrilateral", 3: "hexahedron"}


class Scene(NamedTuple):
    """A scene of this file.

    Attributes:
        steps: The generator, called with options of the problem.
        solvers: Names of solvers beside the default one.
        tight: Tolerances of the run whose forces are compared.
    """

    steps: Callable
    solvers: tuple
    tight: dict


SCENES: dict[str, Scene] = {}


def scene(*solvers, tol=1e-12, geometry_tol=1e-10):
    """Add a scene by the name of its function."""

    def added(steps):
        tight = dict(tol=tol, geometry_tol=geometry_tol)
        SCENES[steps.__name__] = Scene(steps, solvers, tight)
        return steps

    return added


def moved(s, *way):
    """Steps of a body whose top is moved."""
    for top in way:
        s.move_top(*top)
        yield s.problem


def face(domain, axis, at):
    return mesh.locate_entities_boundary(
        domain, domain.topology.dim - 1, lambda x: np.isclose(x[axis], at)
    )


def body(surface, friction, high=(1.0, 1.0, 0.6), cells=(3, 3, 2), cell=None, degree=1, moduli=1000.0, axial=False, hold=None, wear=None, **options):  # fmt: skip
    """A box from the origin, foot on a surface; ``move_top`` moves its head, ``load`` is a force per volume.

    Args:
        axial: Whether the first coordinate is a radius.
        hold: More supports, or others than the head: ``hold(V, head)`` returns them.
    """
    d = len(cells)
    create = mesh.create_box if d == 3 else mesh.create_rectangle
    high = np.array(high[-d:])
    domain = create(COMM, [np.zeros(d), high], cells, getattr(mesh.CellType, cell or KINDS[d]))
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    top, load = (fem.Constant(domain, np.zeros(d)) for _ in range(2))
    r = ufl.SpatialCoordinate(domain)[0]
    if axial:
        strain, test = (ufl.as_tensor([[w[0].dx(0), shear(w), 0], [shear(w), w[1].dx(1), 0], [0, 0, w[0] / r]]) for w in (u, v))  # fmt: skip
        stress = moduli * (0.6 * ufl.tr(strain) * ufl.Identity(3) + 0.8 * strain)
        F = 2 * ufl.pi * r * ufl.inner(stress, test) * ufl.dx(metadata={"quadrature_degree": 3})
    else:
        F = elasticity(u, v, fem.Constant(domain, moduli), 0.3) - ufl.inner(load, v) * ufl.dx
    head = fem.dirichletbc(top, fem.locate_dofs_topological(V, d - 1, face(domain, d - 1, high[-1])), V)  # fmt: skip
    bcs = [head] if hold is None else hold(V, head)
    weight = 2 * ufl.pi * r if axial else None
    contact = dc.Contact(V, face(domain, d - 1, 0.0), surface, friction, wear=wear, weight=weight)
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs, **options)

    def move_top(*way):
        top.value[:] = way

    return SimpleNamespace(problem=problem, contact=contact, surface=surface, u=u, load=load, move_top=move_top, V=V)  # fmt: skip


def shear(w):
    return (w[0].dx(1) + w[1].dx(0)) / 2


def flat(d=3):
    return dc.RigidPlane(np.zeros(d), np.eye(d)[-1], np.eye(3)[0] if d == 3 else None)


# -- planes ------------------------------------------------------------------------------------

DRAG = [(0, 0, -0.005), (0.002, 0.001, -0.008), (0.006, 0.002, -0.008), (0.003, -0.002, -0.006)]
DRAG_2D = [(0, -0.004), (0.001, -0.006), (0.004, -0.006), (0.001, -0.005)]


@scene(*ALL, "SNES")
def cube(**options):
    """Isotropic friction in space: pressed, dragged, dragged back."""
    yield from moved(scenes.block(cells=(3, 3, 2), **EVEN, **options), *DRAG)


@scene(*ALL)
def strip(**options):
    """The same in the plane."""
    yield from moved(scenes.block(cells=(6, 3), **EVEN, **options), *DRAG_2D)


@scene(*ALL)
def grooved(**options):
    """Orthotropic friction and a slip rule that is not associated."""
    yield from moved(scenes.block(cells=(3, 3, 2), **LAW, **options), *DRAG)


@scene()
def associated(**options):
    """Orthotropic friction, the scene turned in space, a lift-off before the last step."""
    s = scenes.block(cells=(3, 3, 2), mu=(0.3, 0.15), p=None, turn=scenes.rotation(1), **options)
    yield from moved(s, *DRAG[:3], (0.006, 0, 0.002), (0.006, 0.001, -0.003))


@scene()
def smooth(**options):
    """No friction."""
    yield from moved(scenes.block(cells=(3, 3, 2), mu=0.0, p=None, **options), *DRAG[:3])


@scene()
def rough(**options):
    """Infinite friction, in the plane."""
    yield from moved(scenes.block(cells=(5, 3), mu=np.inf, p=None, **options), *DRAG_2D[:3])


@scene()
def paper_map(**options):
    """The fixed point with the paper's bipotential map."""
    options["solver"] = dc.FixedPoint(map="bipotential")
    yield from moved(scenes.block(cells=(2, 2, 2), **LAW, **options), *DRAG[:3])


@scene()
def tetrahedra(**options):
    """Second order in tetrahedra, whose vertices carry nothing."""
    s = body(flat(), dc.Friction(**LAW), cells=(2, 2, 1), cell="tetrahedron", degree=2, **options)
    yield from moved(s, *DRAG)


@scene()
def second_order(**options):
    """Second order in quadrilaterals."""
    yield from moved(body(flat(2), 0.3, cells=(4, 2), degree=2, **options), *DRAG_2D)


# -- surfaces that are not flat ------------------------------------------------------------------

OVER = [
    (0, 0, -0.005),
    (0, 0, -0.015),
    (0.005, 0.001, -0.015),
    (0.02, 0.004, -0.015),
    (0.012, 0, -0.01),
]
BALL = (0.45, 0.5, -2.5)  # its centre


def ball(axis=(1, 0, 0)):
    return dc.RigidSphere(BALL, 2.5, axis=axis)


def low(surface, friction, cells=(4, 4, 2), **options):
    """A body that is lower than wide."""
    return body(surface, friction, high=(1, 1, 0.4), cells=cells, **options)


@scene("FixedPoint", "SparseNewton")
def sphere(**options):
    """Over a sphere, friction orthotropic."""
    yield from moved(low(ball(), dc.Friction(**LAW), (5, 5, 2), **options), *OVER)


@scene("FixedPoint")
def cylinder(**options):
    """Over a roller across the way."""
    roller = dc.RigidCylinder((0.45, 0.5, -2.5), (0, 1, 0.005), 2.5)
    yield from moved(low(roller, dc.Friction(**LAW), (6, 2, 2), **options), *OVER)


@scene()
def circle(**options):
    """Over a circle, in the plane."""
    s = body(dc.RigidSphere((0.45, -2.5), 2.5), 0.3, cells=(8, 3), **options)
    yield from moved(s, *((x, z) for x, _, z in OVER))


@scene()
def level_set(**options):
    """Over a saddle given by its distance."""
    saddle = dc.RigidSurface(lambda y: y[2] + 0.15 * (y[0] - 0.4) ** 2 - 0.05 * (y[1] - 0.5) ** 2, axis=(1, 0, 0))  # fmt: skip
    s = body(saddle, dc.Friction(**LAW), cells=(4, 3, 2), **options)
    yield from moved(s, *((x, y, z - 0.005) for x, y, z in OVER))


@scene()
def wavy(**options):
    """Over a wavy plane, nodes going far."""
    plane = dc.RigidPlane((0, 0), (0, 1), height=lambda y: 0.004 * np.cos(5.0 * y[0]))
    s = slab((0, 0), (1, 0.5), (8, 3), plane, 0.3, **options)
    for top in ((0, -0.005), (0.02, -0.005), (0.1, -0.005), (0.08, -0.004)):
        s.held.value[:] = top
        yield s.problem


# -- surfaces that turn ----------------------------------------------------------------------------


@scene("FixedPoint", "SparseNewton")
def turning(**options):
    """A plane that spins and tilts, and friction that turns with it."""
    plane = dc.RigidPlane((0.5, 0.4, 0), (0, 0, 1), axis=(1, 0, 0))
    s = body(plane, dc.Friction(**LAW), **options)
    for down, spin, tilt in ((0.01, 0, 0), (0.02, 0.01, 0), (0.02, 0.1, 0.004), (0.02, 0, -0.005)):
        s.move_top(0, 0, -down)
        plane.rotation = (tilt, 0.3 * tilt, spin)
        yield s.problem


@scene()
def tilting(**options):
    """A plane that tilts, in two dimensions."""
    s = body(flat(2), 0.3, cells=(6, 3), **options)
    for down, tilt in ((0.01, 0), (0.015, 0.01), (0.015, -0.02), (0.02, 0)):
        s.move_top(0, -down)
        s.surface.rotation = tilt
        yield s.problem


@scene()
def drum(**options):
    """A sphere that turns under the body."""
    s = low(ball(), dc.Friction(**LAW), **options)
    for down, turn in ((0.01, 0.0), (0.015, 0.001), (0.015, 0.005), (0.015, 0.002)):
        s.move_top(0, 0, -down)
        s.surface.rotation = (0, turn, 0.5 * turn)
        yield s.problem


# -- surfaces driven by force ------------------------------------------------------------------------


@scene("FixedPoint")
def weight(**options):
    """A plane pressed by force, its stroke prescribed."""
    s = scenes.block(cells=(3, 3, 2), **LAW, **options)
    s.surface.free = ("n",)
    for stroke, press in ((0, 500), (0.001, 500), (0.01, 800), (0.004, 600)):
        s.surface.force = (0, 0, press)
        s.surface.displacement = (stroke, 0.3 * stroke, s.surface.displacement[2])
        yield s.problem


@scene("FixedPoint")
def pulled(**options):
    """A plane pressed and pulled by force; more than friction carries is refused, and the run goes on."""
    s = scenes.block(cells=(3, 3, 2), **EVEN, **options)
    s.surface.free = ("t1", "n")
    for pull, press in ((0, 500), (100, 500), (160, 500), (-100, 700)):
        s.surface.force = (pull, 0, press)
        yield s.problem


@scene()
def tipping(**options):
    """A plane that moments tilt, and the body is dragged along it."""
    plane = dc.RigidPlane((0.5, 0.5, 0), (0, 0, 1), axis=(1, 0, 0))
    s = body(plane, 0.3, high=(1, 1, 1), cells=(3, 3, 2), moduli=2000.0, **options)
    plane.free = ("n", "r1", "r2")
    for press, m1, m2, along in ((20, 0, 0, 0), (20, 1, -0.5, 0), (20, 1, -0.5, 0.01), (40, -4, 3, 0.01)):  # fmt: skip
        plane.force, plane.moment = (0, 0, press), (m1, m2, 0)
        s.move_top(along, 0.3 * along, 0)
        yield s.problem


@scene()
def spring(**options):
    """A plane dragged by the far end of a spring, in two dimensions."""
    s = scenes.block(cells=(5, 3), **EVEN, **options)
    s.surface.free, s.surface.stiffness = ("t", "n"), {"t": 2e4}
    for drive in (0, 0.005, 0.02, 0.01):
        s.surface.force, s.surface.drive = (0, 500), (drive, 0)
        yield s.problem


@scene()
def pressed_ball(**options):
    """A sphere pressed by force, its stroke prescribed."""
    s = low(ball(), 0.3, **options)
    s.surface.free = ("z",)
    for stroke, press in ((0, 3), (0.005, 5), (0.02, 5), (0.01, 6)):
        s.surface.force = (0, 0, press)
        s.surface.displacement = (stroke, 0, s.surface.displacement[2])
        yield s.problem


# -- bodies held by contact alone -----------------------------------------------------------------------


def alone(d, mu=0.4, cells=None, **options):
    """A body without supports."""
    return body(flat(d), mu, cells=cells or {2: (5, 3), 3: (3, 3, 2)}[d], hold=lambda *_: [], **options)  # fmt: skip


@scene("FixedPoint", "CondensedNewton")
def loose(**options):
    """A body under its weight, pushed; more than friction carries is refused."""
    s = alone(3, **options)
    for push, down in ((0, 10), (3, 20), (7, 20), (9, 20), (-4, 15)):
        s.load.value[:] = push, 0.1 * push, -down
        yield s.problem


@scene("FixedPoint")
def loose_strip(**options):
    """The same in the plane."""
    s = alone(2, **options)
    for push, down in ((0, 10), (3, 20), (7, 20), (-5, 20)):
        s.load.value[:] = push, -down
        yield s.problem


@scene()
def nearest(**options):
    """Without friction nothing holds the body along the plane: the nearest state is taken."""
    s = alone(2, mu=0.0, undetermined="nearest", **options)
    for down in (10, 20, 15):
        s.load.value[:] = 0, -down
        yield s.problem


@scene()
def on_a_shaft(**options):
    """A ring with a press fit on a shaft that turns."""
    shaft = dc.RigidSphere((0, 0), 1.0)
    s = ring((0.99, 1.2, 1.5), shaft, 0.3, touching=0.99, held=1.5, **options)
    for turn in (0, 0.002, 0.01, 0.005):
        shaft.rotation = turn
        yield s.problem


# -- nodes that belong to two contacts -------------------------------------------------------------------


def grooved_by(pushes, *given, options, **more):
    s = build_corner(*given, **more)
    problem = dc.ContactProblem(s.F, s.u, s.contacts, bcs=s.bcs, **options)
    for push in pushes:
        s.apply(push)
        yield problem


@scene("FixedPoint")
def corner(**options):
    """The corner of a plate between two planes."""
    way = [Push(), Push(across=0.3), Push(across=-0.3, down=1.2), Push(down=-0.2), Push(0.1, 0.5)]
    yield from grooved_by(way, 90, (3, 3), mu=0.2, turned=17.0, options=options)


@scene()
def edge(**options):
    """The edge of a block in a groove, pressed deeper and dragged along it."""
    way = [Push(along=0.3), Push(down=1.1, along=0.5), Push(0.1, 1.2, 0.9), Push(0.1, 1.1, 1.1)]
    yield from grooved_by(way, 70, (3, 3, 2), mu=0.05, options=options)


@scene()
def edge_of_a_smooth_face(**options):
    """The same with friction on one face alone, dragged from face to face."""
    way = [Push(), Push(across=0.3), Push(across=-0.3, down=1.2, along=0.2)]
    yield from grooved_by(way, 70, (3, 3, 2), mu=[0.0, 0.3], options=options)


@scene()
def floor_and_wall(**options):
    """A block in the corner of a wall and of a floor that force presses."""
    s = build_corner(90, (3, 3), mu=0.1, turned=45.0)
    problem = dc.ContactProblem(s.F, s.u, s.contacts, bcs=s.bcs, **options)
    floor = max(s.contacts, key=lambda c: c.surface.normal[1]).surface
    floor.free = ("n",)
    for across, press in ((0.0, 100), (0.1, 100), (0.15, 120)):
        s.apply(Push(across, down=0.1))
        floor.force = press * floor.normal
        yield problem


# -- supports at the contact nodes ---------------------------------------------------------------------------


def by_the_side(component, value):
    """A support of one component at the side x = 0, beside that of the head."""

    def hold(V, head):
        d, part = V.mesh.geometry.dim, V.sub(component)
        side = fem.locate_dofs_topological(part, d - 1, face(V.mesh, 0, 0.0))
        value.append(fem.Constant(V.mesh, 0.0))
        return [head, fem.dirichletbc(value[0], side, part)]

    return hold


@scene("FixedPoint", "SparseNewton")
def pushed(**options):
    """A support moves the side of the block along the plane, contact nodes included."""
    side = []
    s = body(flat(), dc.Friction(**LAW), hold=by_the_side(0, side), **options)
    for down, along in ((0.01, 0), (0.02, 0.002), (0.02, 0.012), (0.02, 0.004)):
        side[0].value = along
        s.move_top(along, 0.3 * along, -down)
        yield s.problem


@scene()
def oblique(**options):
    """A support holds the side across a direction that is none of the plane's axes."""
    plane = dc.RigidPlane((0, 0, 0), (0, 0, 1), axis=(1, 0.6, 0))
    s = body(plane, dc.Friction(**LAW), hold=by_the_side(1, []), **options)
    yield from moved(s, *((x, 0, z) for x, _, z in DRAG))


@scene()
def released(**options):
    """The side is held along the plane, then released."""
    s = body(flat(2), 0.3, cells=(5, 3), hold=by_the_side(0, []), **options)
    way = moved(s, *DRAG_2D)
    yield next(way)
    yield next(way)
    s.problem.bcs = s.problem.bcs[:1]
    yield from way


# -- wear -------------------------------------------------------------------------------------------------------

K = 2e-2 / E
RUB = [(0, 0, -0.005), (0.02, 0.0, -0.005), (0.2, 0.06, -0.005), (-0.1, 0, -0.006)]


def rubbed(*cells, options, mu=EVEN, **wear):
    return scenes.block(cells=cells, **mu, wear=dc.Wear(K, **wear), **options)


@scene(*ALL)
def worn(**options):
    """Wear within the step, in the plane."""
    yield from moved(rubbed(6, 3, options=options), *((x, z) for x, _, z in RUB))


@scene()
def worn_explicit(**options):
    """The depth of a step opens the gap of the next one."""
    yield from moved(rubbed(3, 3, 2, options=options, mu=LAW, explicit=True), *RUB)


@scene()
def worn_in_part(**options):
    """A coating on one half, and work that is done before wear begins; a coefficient for each direction."""
    s = rubbed(3, 3, 2, options=options, mu=LAW, threshold=0.5)
    s.contact.wear = dc.Wear(lambda x: K * np.stack((1 + x[0], 1.5 - x[1])), threshold=0.5)
    yield from moved(s, *RUB)


@scene()
def worn_under_weight(**options):
    """A plane that force presses on a block which wears."""
    s = rubbed(5, 3, options=options)
    s.surface.free, s.surface.force = ("n",), (0, 500)
    for stroke in (0, 0.05, 0.3):
        s.surface.displacement = (stroke, s.surface.displacement[1])
        yield s.problem


# -- friction that varies ------------------------------------------------------------------------------------------


@scene("FixedPoint")
def fields(**options):
    """Coefficients and directions by the place."""
    s = scenes.block(cells=(3, 3, 2), **LAW, **options)
    s.contact.friction = dc.Friction(mu=lambda x: np.stack((0.3 + 0.2 * x[0], 0.2 + 0.1 * x[1])), axes=lambda x: np.stack((-x[1] - 3, x[0], 0 * x[0])))  # fmt: skip
    yield from moved(s, *DRAG)


@scene("FixedPoint")
def by_pressure(**options):
    """Friction that falls with the pressure, at the end of the step."""
    s = scenes.block(cells=(3, 3, 2), **LAW, **options)
    s.contact.friction = dc.Friction(lambda x, pressure: 0.4 / (1 + pressure / (0.02 * E)))
    yield from moved(s, *DRAG)


@scene()
def ball_by_pressure(**options):
    """The same over a sphere: normals change within the step, too."""
    friction = dc.Friction(lambda x, pressure: 0.15 + 0.25 / (1 + pressure / 100.0))
    yield from moved(low(ball(None), friction, **options), *OVER[1:])


@scene()
def by_path(**options):
    """Friction that rises with the path slipped."""
    s = scenes.block(cells=(6, 3), **EVEN, **options)
    s.contact.friction = dc.Friction(lambda x, slip_path: 0.2 + 20 * np.minimum(slip_path, 0.01))
    yield from moved(s, *DRAG_2D)


# -- two deformable bodies ---------------------------------------------------------------------------------------------

IRON = [0.0, 0.005, 0.2, 0.4, 0.3]
LONG = ((3, 2), (9, 2))


def ironed(s, down=-0.02, way=IRON):
    """Steps of an upper block that is pressed and goes along the lower one."""
    for along in way:
        s.way.value[:] = (along, *[0.3 * along] * (s.domain.geometry.dim - 2), down)
        yield s.problem


@scene("FixedPoint", "SparseNewton")
def small_sliding(**options):
    """Small sliding, in the plane."""
    yield from ironed(blocks("quadrilateral", cells=((4, 2), (5, 2)), **options), -0.01, (0, 0.01, 0.03, 0.015))  # fmt: skip


@scene("FixedPoint")
def small_sliding_in_space(**options):
    """The same in space, friction orthotropic."""
    s = blocks("hexahedron", cells=((3, 3, 1), (4, 4, 1)), size=(1.0, 1.2), axis=(1, 0.2, 0), **LAW, **options)  # fmt: skip
    yield from ironed(s, -0.01, (0, 0.002, 0.008, -0.002))


@scene(*ALL)
def ironing(**options):
    """Large sliding over the facets of the other body."""
    yield from ironed(blocks("quadrilateral", cells=LONG, size=(1.0, 3.0), sliding="large", **options))  # fmt: skip


@scene()
def ironing_in_space(**options):
    """The same in space, obliquely, friction orthotropic."""
    s = blocks("hexahedron", cells=((2, 2, 1), (5, 4, 1)), size=(1.0, 2.0), sliding="large", axis=(1, 0.2, 0), **LAW, **options)  # fmt: skip
    yield from ironed(s, way=IRON[:4])


@scene()
def ironing_second_order(**options):
    """The same in second order, in triangles."""
    s = blocks("triangle", degree=2, cells=((2, 1), (6, 1)), size=(1.0, 3.0), sliding="large", **options)  # fmt: skip
    yield from ironed(s)


@scene()
def over_the_edge(**options):
    """The longer body has the unknowns: nodes come under the other one and leave."""
    s = blocks("quadrilateral", cells=LONG, size=(1.0, 3.0), sliding="large", swapped=True, **options)  # fmt: skip
    yield from ironed(s, way=(0, 0.005, 0.3, 0.7, 0.4))


@scene()
def both_wear(**options):
    """Both bodies wear within the step."""
    s = blocks("quadrilateral", cells=LONG, size=(1.0, 3.0), sliding="large", **options)
    s.contact.wear = dc.Wear(2e-7, opposite=6e-7)
    yield from ironed(s)


@scene()
def both_wear_explicit(**options):
    """Both bodies wear, nodes come and leave, and the depth opens the next step's gap."""
    s = blocks("quadrilateral", cells=LONG, size=(1.0, 3.0), sliding="large", swapped=True, **options)  # fmt: skip
    s.contact.wear = dc.Wear(6e-7, opposite=2e-7, explicit=True)
    yield from ironed(s)


@scene()
def rubber_on_rubber(**options):
    """Two bodies of finite strain."""
    s = blocks("quadrilateral", cells=((3, 2), (6, 2)), size=(1.0, 2.0), sliding="large", form=rubber, **options)  # fmt: skip
    yield from ironed(s, -0.05, (0, 0.02, 0.2, 0.1))


@scene()
def upper_under_load(**options):
    """The upper body is held by the lower one alone."""
    s = blocks("quadrilateral", cells=((3, 2), (4, 2)), size=(1.0, 1.5), held=False, **options)
    for push, press in ((0, 500), (100, 500), (140, 600), (-100, 600)):
        s.load.value[:] = push, -press
        yield s.problem


# -- other bodies ------------------------------------------------------------------------------------------------------


@scene("FixedPoint", "CondensedNewton")
def rubber_block(**options):
    """Finite strain, a bonded head that is dragged."""
    s = nonlinear_scenes.block(cells=(4, 3), mu=0.4, held=True, **options)
    for down, along in ((0.1, 0), (0.2, 0.02), (0.2, 0.15), (0.15, 0.05)):
        nonlinear_scenes.move(s, along, -down)
        yield s.problem


@scene()
def rubber_in_space(**options):
    """The same in space, free to bulge."""
    s = nonlinear_scenes.block(cells=(2, 2, 2), mu=0.3, **options)
    for down in (0.05, 0.15, 0.1):
        nonlinear_scenes.move(s, 0, 0, -down)
        yield s.problem


@scene("FixedPoint")
def mixed(**options):
    """Displacement and pressure, nearly incompressible."""
    s = mixed_scenes.block(3, **options)
    for way in ((0, -0.02), (0.02, -0.03), (0.06, -0.03), (0.03, -0.02)):
        yield SimpleNamespace(solve=partial(s.press, *way), contacts=s.problem.contacts)


@scene()
def axial(**options):
    """A punch of revolution on a plane."""
    s = body(flat(2), 0.2, cells=(6, 3), axial=True, hold=by_the_side(0, []), **options)
    yield from moved(s, (0, -0.005), (0.0, -0.02), (0.0, -0.01))


@scene()
def axial_worn(**options):
    """The same with little friction, and wear."""
    s = body(flat(2), 0.05, cells=(6, 3), axial=True, hold=by_the_side(0, []), wear=dc.Wear(1e-3), **options)  # fmt: skip
    yield from moved(s, (0, -0.01), (0.0, -0.03), (0.0, -0.02), (0.0, -0.03))


# -- runs that are interrupted ---------------------------------------------------------------------------------------------


@contextmanager
def checkpoint():
    """A file name in a folder of its own, the same on all ranks."""
    folder = tempfile.mkdtemp() if COMM.rank == 0 else None
    file = Path(COMM.bcast(folder)) / "golden.npz"
    yield file
    COMM.barrier()
    if COMM.rank == 0:
        file.unlink()
        file.parent.rmdir()


def restarted(steps, **options):
    """The steps of a scene; those after the second one are made by another problem, which reads a checkpoint."""
    first, second = steps(**options), steps(**options)
    for _ in range(2):
        problem = next(first)
        yield problem
    anew = next(second)
    next(second)
    with checkpoint() as file:
        problem.save(file)
        anew.load(file)
    yield from second


@scene("FixedPoint")
def restart(**options):
    """A block that wears."""
    yield from restarted(worn, **options)


@scene()
def restart_between_bodies(**options):
    """Two bodies that wear, nodes come and leave."""
    yield from restarted(both_wear_explicit, **options)


@scene()
def restart_driven(**options):
    """A plane driven by force."""
    yield from restarted(weight, **options)


@scene("FixedPoint")
def rewound(**options):
    """The second step is taken back, and another one made."""
    s = rubbed(3, 3, 2, options=options, mu=LAW)
    yield from moved(s, RUB[0], (0.05, -0.02, -0.008))
    s.problem.rewind()
    yield from moved(s, *RUB[1:3])


@scene()
def rewound_between_bodies(**options):
    """The same between bodies that wear."""
    s = blocks("quadrilateral", cells=LONG, size=(1.0, 3.0), sliding="large", **options)
    s.contact.wear = dc.Wear(2e-7, opposite=6e-7)
    yield from ironed(s, way=IRON[:3])
    s.problem.rewind()
    yield from ironed(s, way=(0.1, 0.15))
