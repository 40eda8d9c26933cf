# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Files of ``dc.Writer``: whoever reads them finds each node once, every value at its node, and sums that are the contact's."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem
from patches import CELLS, PRESSURE, pressed
from two_bodies import pair

from dolfinx_contact.compat import functionspace
from dolfinx_contact.results.meshes import recovered

pytestmark = pytest.mark.ranks
COMM = scenes.COMM
BODIES = [
    cell for cell in CELLS if cell != "prism"
]  # whose facets DOLFINx 0.5 finds on one rank alone


def by_meshio(path):
    """Points, number of cells, values at points and at cells."""
    meshio = pytest.importorskip("meshio")
    found = meshio.read(path)
    at_cells = {name: np.concatenate(parts) for name, parts in found.cell_data.items()}
    return found.points, sum(len(of.data) for of in found.cells), found.point_data, at_cells


def by_pyvista(path):
    pyvista = pytest.importorskip("pyvista")
    found = pyvista.read(path)
    return found.points, found.n_cells, dict(found.point_data), dict(found.cell_data)


READERS = pytest.mark.parametrize("read", [by_meshio, by_pyvista])


@pytest.fixture
def folder(tmp_path):
    return COMM.bcast(tmp_path, root=0)


def on_first(work):
    """Call ``work`` where the files were written; a failure is one of all ranks, none goes on alone."""
    said = None
    if COMM.rank == 0:
        try:
            work()
        except BaseException as failure:
            said = failure
            if COMM.size == 1:
                raise
    said = COMM.bcast(said, root=0)
    if said is not None:
        raise said


@READERS
@pytest.mark.parametrize("cell", BODIES)
@pytest.mark.parametrize("degree", [1, 2])
def test_an_even_state_is_read_back(cell, degree, read, folder):
    """Of an even stress, turned in space, files have the exact displacement at every node of the body, and on the surface
    alone its pressure, friction stress and slip, at vertices of second-order tetrahedra, too."""
    found = pressed(cell, degree, True, True, distorted=False)
    contact, d = found.contact, found.mesh.geometry.dim
    dc.Writer(found.problem, folder / "a.pvd", fields={"gradient": ufl.grad(found.u)}).write(0.0)
    force, nodes = contact.force(), found.V.dofmap.index_map.size_global
    cells = found.mesh.topology.index_map(d).size_global
    places = np.concatenate(COMM.allgather(contact.x))
    turn = contact.frame

    def check():
        x, count, u, of_cells = read(folder / "a_data" / "body000000.vtu")
        assert (len(x), count) == (nodes, cells)
        assert len(np.unique(x.round(9), axis=0)) == nodes
        exact = found.moved(x.T).T
        assert np.abs(u["displacement"][:, :d] - exact).max() <= 1e-9 * np.abs(exact).max()
        tensors = of_cells["gradient"].reshape(-1, 3, 3)[:, :d, :d]
        gradient = found.moved(np.eye(d)) - found.moved(np.zeros((d, 1)))
        assert np.abs(tensors - gradient).max() <= 1e-9 * np.abs(gradient).max()
        x, _, values, _ = read(folder / "a_data" / "contact000000.vtu")
        assert len(np.unique(x.round(9), axis=0)) == len(x) >= len(places)
        assert values["contact_node"].sum() == len(places)
        assert values["reaction"].sum(axis=0)[:d] == pytest.approx(force, rel=1e-9)
        assert values["pressure"] == pytest.approx(PRESSURE, rel=1e-9)
        shear = found.traction[:-1] @ turn[:-1]
        assert np.abs(values["shear_traction"][:, :d] - shear).max() <= 1e-9 * PRESSURE
        assert np.abs(values["slip"][:, :d] - found.slip[:-1] @ turn[:-1]).max() <= 1e-11
        assert (values["status"] == dc.Status.SLIP).all()
        assert np.abs(values["gap"]).max() <= 1e-11

    on_first(check)


@pytest.mark.parametrize("cell", BODIES)
@pytest.mark.parametrize("degree", [1, 2])
def test_cells_have_vtks_order(cell, degree, folder):
    """VTK finds the volume of the unit cube and the area of its face in the cells of the files, all parts positive."""
    pyvista = pytest.importorskip("pyvista")
    found = pressed(cell, degree, False, False)
    dc.Writer(found.problem, folder / "a.pvd").write(0.0)

    def check():
        for part, dim in (
            ("body", found.mesh.geometry.dim),
            ("contact", found.mesh.geometry.dim - 1),
        ):
            sizes = pyvista.read(folder / "a_data" / f"{part}000000.vtu").compute_cell_sizes()
            size = sizes[{1: "Length", 2: "Area", 3: "Volume"}[dim]]
            assert size.sum() == pytest.approx(1.0, rel=1e-9) and size.min() > 0

    on_first(check)


@READERS
def test_a_series_has_the_forces_of_its_steps(read, folder):
    """In every step of a sliding block nodal forces of the file add up to ``contact.force()``; zones are in the file."""
    scene = scenes.block(wear=dc.Wear(1e-6))
    writer, forces, worn = dc.Writer(scene.problem, folder / "run.pvd"), [], []
    for k, x in enumerate((0.0, 0.002, 0.004)):
        scene.move_top(x, 0.5 * x, -0.01)
        scene.problem.solve()
        writer.write(0.1 * k)
        forces.append(scene.contact.force())
        worn.append(COMM.allreduce(scene.contact.wear_depth.sum()))
    status = np.bincount(np.concatenate(COMM.allgather(scene.contact.status)), minlength=3)

    def check():
        for k, (force, depth) in enumerate(zip(forces, worn)):
            _, _, values, _ = read(folder / "run_data" / f"contact{k:06d}.vtu")
            assert values["reaction"].sum(axis=0) == pytest.approx(force, rel=1e-12)
            assert values["wear_depth"].sum() == pytest.approx(depth, rel=1e-12)
        assert np.array_equal(np.bincount(values["status"], minlength=3), status)

    on_first(check)


def test_a_series_goes_on_after_a_restart(folder):
    """``resume`` keeps the steps before the checkpoint and writes over later ones; PyVista reads the collection's times."""
    scene = scenes.block(cells=(2, 2, 1))
    scene.move_top(0, 0, -0.01)
    scene.problem.solve()
    first = dc.Writer(scene.problem, folder / "run.pvd")
    for time in (0.0, 1.0, 2.0):
        first.write(time)
    again = dc.Writer(scene.problem, folder / "run.pvd", resume=2)
    again.write(1.5)
    assert again.times == [0.0, 1.0, 1.5]

    def check():
        pyvista = pytest.importorskip("pyvista")
        for name in ("run.pvd", "run_contact.pvd"):
            reader = pyvista.get_reader(folder / name)
            assert reader.time_values == again.times
            reader.set_active_time_value(1.5)
            assert reader.read()[0].n_points > 0

    on_first(check)


def test_mistakes_are_refused(folder):
    """Another ending, a taken name, a negative or too large ``resume``, a file of something else and a time that is not
    finite are a ValueError that names them, on all ranks; a folder that cannot be made an OSError."""
    scene = scenes.block(cells=(2, 2, 1))
    path = folder / "run.pvd"
    for options, said in (
        ({"path": folder / "run.vtk"}, "must end in .pvd"),
        ({"fields": {"displacement": scene.u}}, "displacement is written anyway"),
        ({"fields": {"mises": 3.0}}, r"fields\['mises'\] must be a Function or .* got 3.0"),
        ({"problem": scene.contact}, "problem must be a ContactProblem, got <Contact of"),
        ({"resume": -1}, "resume must be"),
        ({"resume": 1}, "no series"),
    ):
        with pytest.raises(ValueError, match=said):
            dc.Writer(**{"problem": scene.problem, "path": path} | options)
    writer = dc.Writer(scene.problem, path)
    with pytest.raises(ValueError, match="time must be finite, got nan"):
        writer.write(np.nan)
    writer.write(0.0)
    with pytest.raises(ValueError, match="has 1 of them"):
        dc.Writer(scene.problem, path, resume=2)
    COMM.barrier()
    if COMM.rank == 0:
        path.write_text("<VTKFile")
    COMM.barrier()
    with pytest.raises(ValueError, match="no series"):
        dc.Writer(scene.problem, path, resume=1)
    with pytest.raises(OSError):
        dc.Writer(scene.problem, path / "within.pvd").write(0.0)


@READERS
def test_fields_of_users(read, folder):
    """A Function of first order is there at the nodes of second order, a vector in the plane has three components, and an
    expression the value in the middle of each cell."""
    found = pressed("triangle", 2, False, False)
    x = ufl.SpatialCoordinate(found.mesh)
    linear = fem.Function(functionspace(found.mesh, ("Lagrange", 1)))
    linear.interpolate(lambda x: 3 * x[0] - x[1])
    dc.Writer(
        found.problem, folder / "a.pvd", fields={"T": linear, "x": x, "height": x[1] ** 2}
    ).write(0)

    def check():
        points, count, at_points, at_cells = read(folder / "a_data" / "body000000.vtu")
        assert at_points["T"] == pytest.approx(3 * points[:, 0] - points[:, 1], abs=1e-12)
        assert at_cells["x"].shape == (count, 3) and not at_cells["x"][:, 2].any()
        assert at_cells["height"] == pytest.approx(at_cells["x"][:, 1] ** 2, abs=1e-12)

    on_first(check)


def test_a_recovered_pressure_keeps_the_resultant():
    """On any triangles a linear pressure is recovered exactly; of any other one the integral of linear pieces between all six
    nodes is that of the middles, A/3 times their sum."""
    from scipy.spatial import Delaunay

    random = np.random.default_rng(3)
    corners = random.random((30, 2))
    flat = Delaunay(corners).simplices
    pairs = np.sort(flat[:, [(0, 1), (1, 2), (2, 0)]], axis=2)
    edges, of = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    x = np.zeros((30 + len(edges), 3))
    x[:30, :2], x[30:, :2] = corners, corners[edges].mean(axis=1)
    triangles = np.hstack((flat, 30 + of.reshape(-1, 3)))
    sides = corners[flat[:, 1:]] - corners[flat[:, :1]]
    area = np.abs(np.linalg.det(sides)) / 2
    nodes = (np.arange(len(x)) >= 30).astype(int)
    for p in (2 + x[:, 0] - x[:, 1], 2 + random.random(len(x))):
        values = {
            "pressure": p * nodes,
            "wear_depth": 0 * p,
            "shear_traction": x * 0,
            "slip": x * 0,
        }
        recovered(x, triangles, values | {"contact_node": nodes, "status": nodes.copy()})
        found = values["pressure"]
        pieces = triangles[:, [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]]
        integral = area @ found[pieces].mean(axis=2).mean(axis=1)
        assert integral == pytest.approx(area @ p[triangles[:, 3:]].mean(axis=1), rel=1e-12)
        assert np.array_equal(found[30:], p[30:])
        if np.allclose(p, 2 + x[:, 0] - x[:, 1]):
            assert found == pytest.approx(p, rel=1e-12)


@pytest.mark.parametrize("cell, degree", [("hexahedron", 1), ("triangle", 2)])
def test_two_bodies_on_a_plane(cell, degree, folder):
    """Of a block that slides on a block that lies on a plane the file has both contacts, each with the sum of its own forces."""
    d = 2 if cell == "triangle" else 3
    domain, top, bottom, upper, lower, _ = pair(cell, [[2] * d, [3] * d], size=(0.7, 1.0))
    V = functionspace(domain, ("Lagrange", degree, (d,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, np.zeros(d))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, d - 1, top), V)
    contacts = [
        dc.Contact(V, upper, dc.DeformableSurface(V, lower), 0.2),
        dc.Contact(V, bottom, dc.RigidPlane(-np.eye(d)[-1], np.eye(d)[-1]), 0.3),
    ]
    problem = dc.ContactProblem(scenes.elasticity(u, v, 210e3, 0.3), u, contacts, bcs=[bc])
    for way in (0.0, 0.01):
        held.value = (way, *np.zeros(d - 2), -0.01)
        problem.solve()
    dc.Writer(problem, folder / "a.pvd").write(0.0)
    forces, count = [contact.force() for contact in contacts], V.dofmap.index_map.size_global
    assert forces[0] == pytest.approx(forces[1], rel=1e-6, abs=1e-6 * forces[0][-1])

    def check():
        for read in (by_meshio, by_pyvista):
            assert len(read(folder / "a_data" / "body000000.vtu")[0]) == count
            _, _, values, _ = read(folder / "a_data" / "contact000000.vtu")
            for k, force in enumerate(forces):
                found = values["reaction"][values["contact"] == k].sum(axis=0)[:d]
                assert found == pytest.approx(force, rel=1e-9, abs=1e-9 * np.abs(force).max())

    on_first(check)
