# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Bodies on submeshes, and forms with Functions on submeshes of theirs: entity maps."""

from inspect import signature
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact.compat import functionspace, mixed_functionspace
from mechanics.material import elasticity

pytestmark = pytest.mark.ranks
E, NU = 200.0, 0.3
KNOWN = "entity_maps" in signature(fem.form).parameters
needs_maps = pytest.mark.skipif(not KNOWN, reason="this DOLFINx has no entity maps")


def cube(gdim, n=4):
    create = mesh.create_box if gdim == 3 else mesh.create_rectangle
    kind = mesh.CellType.hexahedron if gdim == 3 else mesh.CellType.quadrilateral
    return create(MPI.COMM_WORLD, [np.zeros(gdim), np.ones(gdim)], [n] * gdim, kind)


def face(domain, axis, at):
    return mesh.locate_entities_boundary(
        domain, domain.topology.dim - 1, lambda x: np.isclose(x[axis], at)
    )


def between_planes(domain, height, V=None, nu=NU, top=True):
    """Free to bulge, on a plane without friction; the top moves by ``moved``."""
    d = domain.topology.dim
    V = functionspace(domain, ("Lagrange", 1, (d,))) if V is None else V
    scene = SimpleNamespace(d=d, V=V, u=fem.Function(V), v=ufl.TestFunction(V), mesh=domain)
    scene.moved, zero = fem.Constant(domain, 0.0), fem.Constant(domain, 0.0)

    def fix(axis, at, value):
        part = V.sub(axis)
        dofs = fem.locate_dofs_topological(part, d - 1, face(domain, axis, at))
        return fem.dirichletbc(value, dofs, part)

    scene.bcs = [fix(axis, 0.0, zero) for axis in range(d - 1)]
    scene.bcs += [fix(d - 1, height, scene.moved)] if top else []
    plane = dc.RigidPlane(point=np.zeros(d), normal=np.eye(d)[-1])
    scene.contact = dc.Contact(V, face(domain, d - 1, 0.0), plane, dc.Friction(mu=0.0))
    return scene


def part_of(domain, dim, entities):
    """The submesh of some entities, and what ``entity_maps`` takes for it: a list since 0.10, a dictionary before."""
    part, to_parent, *_ = mesh.create_submesh(domain, dim, entities)
    if hasattr(mesh, "EntityMap"):
        return part, [to_parent]
    index_map = domain.topology.index_map(dim)
    to_part = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int32)
    to_part[to_parent] = np.arange(len(to_parent))
    return part, {part: to_part}


@pytest.mark.parametrize("gdim", [2, 3])
def test_the_body_is_a_submesh(gdim, tmp_path):
    """The lower half of a cube alone is pressed: the force is E times the strain, also after a checkpoint."""
    parent = cube(gdim)
    lower = mesh.locate_entities(parent, gdim, lambda x: x[gdim - 1] < 0.5 + 1e-9)
    scene = between_planes(mesh.create_submesh(parent, gdim, lower)[0], 0.5)
    F = elasticity(scene.u, scene.v, E, NU)
    problem = dc.ContactProblem(F, scene.u, [scene.contact], bcs=scene.bcs, tol=1e-10)
    modulus = E if gdim == 3 else E / (1 - NU**2)
    path = MPI.COMM_WORLD.bcast(tmp_path) / "checkpoint.npz"
    for down in (0.01, 0.02):
        scene.moved.value = -down
        problem.solve()
        assert scene.contact.force()[-1] == pytest.approx(modulus * down / 0.5, rel=1e-9)
        problem.save(path)
    problem.reset()
    problem.load(path)
    assert scene.contact.force()[-1] == pytest.approx(modulus * 0.02 / 0.5, rel=1e-9)


@needs_maps
@pytest.mark.parametrize("gdim", [2, 3])
def test_a_traction_on_a_submesh_of_facets(gdim):
    """A traction on the surface mesh of the top is what the plane carries, and may change between steps."""
    domain = cube(gdim)
    scene = between_planes(domain, 1.0, top=False)
    domain.topology.create_entities(gdim - 1)
    top = face(domain, gdim - 1, 1.0)
    surface, maps = part_of(domain, gdim - 1, top)
    traction = fem.Function(functionspace(surface, ("Lagrange", 1, (gdim,))))
    tags = mesh.meshtags(domain, gdim - 1, np.sort(top), np.ones(top.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
    F = elasticity(scene.u, scene.v, E, NU) - ufl.inner(traction, scene.v) * ds(1)
    problem = dc.ContactProblem(
        F, scene.u, [scene.contact], bcs=scene.bcs, tol=1e-10, entity_maps=maps
    )
    for pressure in (1.0, 3.0):
        traction.interpolate(
            lambda x, p=pressure: np.vstack([0 * x[0]] * (gdim - 1) + [-2 * p * x[0]])
        )
        problem.solve()
        assert scene.contact.force()[-1] == pytest.approx(pressure, rel=1e-9)


def two_layers(**more):
    """A cube without Poisson's ratio whose upper half has a modulus on a submesh of its own."""
    domain = cube(2)
    scene = between_planes(domain, 1.0)
    upper = mesh.locate_entities(domain, 2, lambda x: x[1] > 0.5 - 1e-9)
    part, scene.maps = part_of(domain, 2, upper)
    scene.modulus = fem.Function(functionspace(part, ("DG", 0)))
    index_map = domain.topology.index_map(2)
    values = np.ones(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    values[upper] = 2
    tags = mesh.meshtags(domain, 2, np.arange(values.size, dtype=np.int32), values)
    dx = ufl.Measure("dx", domain=domain, subdomain_data=tags)
    scene.lower = elasticity(scene.u, scene.v, E, 0.0, dx(1))
    scene.F = scene.lower + elasticity(scene.u, scene.v, scene.modulus, 0.0, dx(2))
    return scene


@pytest.mark.skipif(
    not hasattr(mesh, "EntityMap"), reason="maps of this DOLFINx have one direction"
)
def test_a_function_of_the_whole_mesh_on_a_body_that_is_a_part():
    """The body is a submesh, its modulus a Function of the whole mesh: the force is that of the modulus there."""
    parent = cube(2)
    lower = mesh.locate_entities(parent, 2, lambda x: x[1] < 0.5 + 1e-9)
    part, maps = part_of(parent, 2, lower)
    scene = between_planes(part, 0.5)
    modulus = fem.Function(functionspace(parent, ("DG", 0)))
    modulus.interpolate(lambda x: np.where(x[1] < 0.5, 50.0, 800.0))
    dx = ufl.Measure("dx", domain=part)
    F = elasticity(scene.u, scene.v, modulus, 0.0, dx)
    problem = dc.ContactProblem(
        F, scene.u, scene.contact, bcs=scene.bcs, tol=1e-10, entity_maps=maps
    )
    scene.moved.value = -0.01
    problem.solve()
    assert scene.contact.force()[-1] == pytest.approx(50.0 * 0.01 / 0.5, rel=1e-9)


@needs_maps
def test_a_stiffness_on_a_submesh_of_cells():
    """Two layers in a row: the compliances add up, whatever the modulus of the one on the submesh."""
    scene = two_layers()
    problem = dc.ContactProblem(
        scene.F, scene.u, scene.contact, bcs=scene.bcs, tol=1e-10, entity_maps=scene.maps
    )
    scene.moved.value = -0.01
    for modulus in (50.0, 800.0):
        scene.modulus.x.array[:] = modulus
        problem.solve()
        force = 0.01 / (0.5 / E + 0.5 / modulus)
        assert scene.contact.force()[-1] == pytest.approx(force, rel=1e-9)


@needs_maps
def test_state_on_a_submesh(tmp_path):
    """A layer that softens with its strain, held on a submesh: steps move it on, failed ones do not, and a checkpoint, which
    has no number for its cells, is refused."""
    scene = two_layers()
    part = scene.modulus.function_space.mesh
    count = fem.Function(functionspace(part, ("DG", 0)))
    J = ufl.derivative(scene.F, scene.u, ufl.TrialFunction(scene.V))

    def before(u):
        scene.modulus.x.array[:] = 100.0 / (1 + count.x.array)

    def after(u):
        count.x.array[:] += 1.0

    internal = dc.InternalVariables([count], before_residual=before, after_step=after)
    options = dict(internal=internal, J=J)
    problem = dc.ContactProblem(
        scene.F, scene.u, scene.contact, bcs=scene.bcs, tol=1e-10, entity_maps=scene.maps, **options
    )
    scene.moved.value = -0.01
    for steps in range(3):
        problem.solve()
        force = 0.01 / (0.5 / E + 0.5 * (1 + steps) / 100.0)
        assert scene.contact.force()[-1] == pytest.approx(force, rel=1e-9)
    scene.moved.value = np.nan
    with pytest.raises(ValueError, match="NaN"):
        problem.solve()
    assert (count.x.array == 3.0).all()
    with pytest.raises(ValueError, match="submesh"):
        problem.save(MPI.COMM_WORLD.bcast(tmp_path) / "checkpoint.npz")


@needs_maps
def test_estimate_knows_entity_maps():
    """The estimated error of a solution that the first order contains is nothing."""
    problems = []
    scene = two_layers()
    scene.modulus.x.array[:] = 50.0
    scene.moved.value = -0.01
    problems.append(
        dc.ContactProblem(
            scene.F, scene.u, scene.contact, bcs=scene.bcs, tol=1e-10, entity_maps=scene.maps
        )
    )
    finer = between_planes(scene.mesh, 1.0, functionspace(scene.mesh, ("Lagrange", 2, (2,))))
    finer.moved.value = -0.01
    F = ufl.replace(scene.F, {scene.u: finer.u, scene.v: finer.v})
    problems.append(
        dc.ContactProblem(
            F, finer.u, finer.contact, bcs=finer.bcs, tol=1e-10, entity_maps=scene.maps
        )
    )
    for problem in problems:
        problem.solve()
    assert dc.estimate(*problems).energy_norm < 1e-7


def test_another_mesh_needs_entity_maps():
    """A Function on another mesh without entity maps, and entity maps of a DOLFINx that has none, are said to be so."""
    scene = two_layers()
    arguments = dict(F=scene.F, u=scene.u, contacts=scene.contact, bcs=scene.bcs)
    with pytest.raises(ValueError, match="another mesh than u: give the entity_maps"):
        dc.ContactProblem(**arguments)
    if not KNOWN:
        with pytest.raises(ValueError, match=r"entity_maps need DOLFINx 0\.9 or newer, this is"):
            dc.ContactProblem(**arguments, entity_maps=[])


def test_checkpoints_of_mixed_spaces_on_submeshes_are_refused(tmp_path):
    """Their unknowns are named by cells, and those of a submesh have no number."""
    parent = cube(2)
    lower = mesh.locate_entities(parent, 2, lambda x: x[1] < 0.5 + 1e-9)
    body = mesh.create_submesh(parent, 2, lower)[0]
    W = mixed_functionspace(body, [("Lagrange", 2, (2,)), ("Lagrange", 1)])
    w, (v, q) = fem.Function(W), ufl.TestFunctions(W)
    u, p = ufl.split(w)
    strain = ufl.sym(ufl.grad(u))
    F = ufl.inner(2 * strain - p * ufl.Identity(2), ufl.grad(v)) * ufl.dx - (ufl.div(u) + p / E) * q * ufl.dx  # fmt: skip
    V, _ = W.sub(0).collapse()
    held = fem.Function(V)
    bc = fem.dirichletbc(
        held, fem.locate_dofs_topological((W.sub(0), V), 1, face(body, 1, 0.5)), W.sub(0)
    )
    plane = dc.RigidPlane(point=(0, 0), normal=(0, 1))
    contact = dc.Contact(W, face(body, 1, 0.0), plane, dc.Friction(mu=0.0))
    problem = dc.ContactProblem(F, w, [contact], bcs=[bc])
    held.x.array[1::2] = -0.01
    assert problem.solve().counts.open == 0
    with pytest.raises(ValueError, match="submesh"):
        problem.save(MPI.COMM_WORLD.bcast(tmp_path) / "checkpoint.npz")
