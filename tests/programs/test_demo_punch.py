# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch: its mesh, the demo's functions, and the paper's programme against reference values."""

import json
import shutil
import tempfile
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import CellType
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
import demo_own_loop
import demo_punch

from studies.punch import Parameters, Punch, programme
from studies.punch.contact_map import draw, gather
from studies.punch.mesh import CONTACT, TOP, punch_mesh

COMM = MPI.COMM_WORLD
COARSE = dict(divisions=2, layers=1)
STEP_KEYS = {
    "displacement",
    "normal_reaction",
    "tangential_reaction_sum",
    "open",
    "stick",
    "slip",
    "error",
    "bipotential_gap",
    "iterations",
    "seconds",
}


@pytest.fixture
def directory():
    """A directory that all ranks share; pytest's own ones differ, and their removal is a race."""
    made = tempfile.mkdtemp() if COMM.rank == 0 else None
    directory = Path(COMM.bcast(made))
    yield directory
    COMM.Barrier()
    if COMM.rank == 0:
        shutil.rmtree(directory)


def total(value):
    return COMM.allreduce(value, op=MPI.SUM)


def owned_coordinates(mesh):
    return mesh.geometry.x[: mesh.geometry.index_map().size_local]


def integral(mesh, integrand, measure):
    one = fem.Constant(mesh, 1.0)
    return total(fem.assemble_scalar(fem.form(one * integrand * measure)))


def run_quietly(punch):
    return [punch.press(displacement) for displacement in programme(punch.parameters)]


@pytest.mark.parametrize(
    "options, cells, nodes, contact_nodes",
    [
        (dict(), 1280, 1685, 337),
        (COARSE, 20, 50, 25),
        (dict(refine=1, **COARSE), 160, 267, 89),
        (dict(refine=-1, divisions=4, layers=2), 20, 50, 25),
    ],
)
def test_mesh_counts(options, cells, nodes, contact_nodes):
    """The mesh has the paper's numbers, on any number of ranks; one level doubles all divisions."""
    punch = punch_mesh(COMM, **options)
    x = owned_coordinates(punch.mesh)
    assert punch.mesh.topology.index_map(3).size_global == cells
    assert total(len(x)) == nodes
    assert total(np.count_nonzero(x[:, 2] == 0)) == contact_nodes
    assert punch.mesh.topology.cell_type == CellType.hexahedron


@pytest.mark.parametrize("radius, height", [(10.0, 10.0), (1e-6, 3e-6), (7e5, 2e5)])
def test_mesh_geometry(radius, height):
    """The rim lies on the circle and the tagged faces are the polygon's area, in any unit."""
    punch = punch_mesh(COMM, radius=radius, height=height, divisions=4, layers=2)
    distance = np.hypot(*owned_coordinates(punch.mesh)[:, :2].T)
    rim = distance > 0.98 * radius
    assert total(np.count_nonzero(rim)) == 16 * 3
    assert np.abs(distance[rim] / radius - 1).max(initial=0) < 1e-14
    polygon = 8 * radius**2 * np.sin(2 * np.pi / 16)
    ds = ufl.Measure("ds", domain=punch.mesh, subdomain_data=punch.facet_tags)
    z = ufl.SpatialCoordinate(punch.mesh)[2] / height
    for tag, level in ((CONTACT, 0.0), (TOP, 1.0)):
        area = integral(punch.mesh, 1.0, ds(tag))
        assert area == pytest.approx(polygon, rel=1e-12)
        assert integral(punch.mesh, (z - level) ** 2, ds(tag)) <= 1e-24 * area
    volume = integral(punch.mesh, 1.0, ufl.dx(domain=punch.mesh))
    assert volume == pytest.approx(polygon * height, rel=1e-12)


def test_layers_grow_from_the_plane():
    """The lowest layer is as high as asked for, each next one higher by the same factor, and the last one ends on top."""
    punch = Punch(Parameters(refine=1, lowest=0.1, height=5.0), divisions=2, layers=2)
    x = owned_coordinates(punch.mesh)
    levels = np.unique(np.concatenate(COMM.allgather(x[:, 2])).round(9))
    heights = np.diff(levels)
    assert heights[0] == pytest.approx(0.1, rel=1e-6)
    assert heights[1:] / heights[:-1] == pytest.approx([heights[1] / heights[0]] * 3, rel=1e-6)
    assert heights[1] > heights[0] and levels[-1] == 5.0


@pytest.mark.parametrize(
    "options",
    [
        dict(refine=-3),
        dict(refine=0.5),
        dict(divisions=3),
        dict(layers=0),
        dict(radius=0),
        dict(lowest=2.5),
        dict(lowest=-1.0),
    ],
)
def test_mesh_refuses(options):
    """A mesh that cannot be built is a ValueError that names the number."""
    with pytest.raises(ValueError, match=str(next(iter(options.values())))):
        punch_mesh(COMM, **options)


def test_programme():
    """A cycle is 5 increments down and 10 up; later cycles start where unloading ended."""
    steps = programme(Parameters(cycles=2, unload_to=0.02))
    down = [0.02, 0.04, 0.06, 0.08, 0.1]
    up = [0.092, 0.084, 0.076, 0.068, 0.06, 0.052, 0.044, 0.036, 0.028, 0.02]
    again = [0.036, 0.052, 0.068, 0.084, 0.1]
    assert steps == pytest.approx(down + up + again + up)
    for wrong in (dict(unload_to=0.1), dict(cycles=0), dict(loading=0), dict(unloading=-1)):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            programme(Parameters(**wrong))


# Total normal reaction and sum of the norms of tangential ones, N, after loading: computed for
# this mesh by an independent program, given to a tenth of a newton (paper's mesh, bonded platen).
REFERENCE = {
    "A": (728548.3, 136696.7),
    "B": (729292.1, 138683.9),
    "C": (722925.4, 125493.8),
}


@pytest.mark.parametrize("case", "ABC")
def test_paper_cycle(case):
    """One cycle on the paper's mesh: every step converges, totals are those known elsewhere."""
    punch = Punch(Parameters(case=case, tol=1e-10))
    records = run_quietly(punch)
    assert punch.head()["unknowns"] == 5055
    for record in records:
        assert 0 <= record["error"] <= 1e-10
        assert record["open"] + record["stick"] + record["slip"] == 337
        work = record["normal_reaction"] * record["displacement"]
        assert 0 <= record["bipotential_gap"] < 1e-8 * work
    loaded = records[4]
    assert loaded["displacement"] == pytest.approx(0.1)
    totals = loaded["normal_reaction"], loaded["tangential_reaction_sum"]
    assert totals == pytest.approx(REFERENCE[case], abs=0.11)
    # what unloading leaves behind is smaller and friction has turned round
    assert records[-1]["normal_reaction"] < records[0]["normal_reaction"]
    if case == "A":
        unloaded = records[-1]["normal_reaction"], records[-1]["tangential_reaction_sum"]
        assert unloaded == pytest.approx((137076.4, 25818.9), rel=3e-5)


def test_steps_start_from_the_nearer_state():
    """Of the last state and the extrapolation of the last two, each step of case C starts from the one nearer to
    its solution, in energy: the extrapolation in all steps but the first of loading and of unloading."""

    distances = []
    punch = Punch(Parameters(case="C", tol=1e-10, refine=-1), solver=dc.FixedPoint())
    body = punch.problem.body
    last = before = np.zeros(body.size)
    for displacement in programme(punch.parameters):
        punch.approach.value = -displacement
        begun = punch.problem.load_step().start().x
        punch.press(displacement)
        solution = punch.u.x.array[: body.size].copy()
        steps = [solution - start for start in (begun, last, 2 * last - before)]
        last, before = solution, last
        distances.append([body.total(step @ body.multiply(step)) for step in steps])
    for index, (start, last, extrapolated) in enumerate(distances):
        assert start <= 1.01 * min(last, extrapolated) + 1e-9 * distances[0][1]
        assert (extrapolated < last) == (index not in (0, 5))


@pytest.mark.skipif(COMM.size == 1, reason="compares several ranks with one")
@pytest.mark.parametrize("case", "ABC")
def test_ranks_agree(case):
    """Distributed over all ranks, the totals are those that one rank alone computes, to 1e-8."""
    parameters = Parameters(case=case, tol=1e-11, loading=1, unloading=4)
    together = run_quietly(Punch(parameters, COMM, **COARSE))
    alone = run_quietly(Punch(parameters, MPI.COMM_SELF, **COARSE))
    for shared, own in zip(together, alone, strict=True):
        for key in ("normal_reaction", "tangential_reaction_sum"):
            assert shared[key] == pytest.approx(own[key], rel=1e-8)
        for key in ("open", "stick", "slip"):
            assert shared[key] == own[key]


def test_free_top():
    """A top face free to move sideways is softer, and its anchor carries nothing, by symmetry."""
    bonded, free = (Punch(Parameters(top=top), **COARSE) for top in ("bonded", "free"))
    bonded.press(0.1)
    free.press(0.1)
    force = free.contact.force()
    assert 0 < force[2] < bonded.contact.force()[2]
    assert np.abs(force[:2]).max() < 1e-7 * force[2]
    with pytest.raises(ValueError, match="'glued'"):
        Punch(Parameters(top="glued"), **COARSE)


def test_tracked_point():
    """P is the contact node nearest to what was asked for, known to all ranks."""
    punch = Punch(Parameters(point=(9.0, 0.3)), **COARSE)
    assert punch.head()["point"] == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)
    default = Punch(Parameters()).head()["point"]
    assert default[0] == pytest.approx(default[1])
    assert np.hypot(*default[:2]) == pytest.approx(7.5, abs=0.27)  # half a node's distance
    record = punch.press(0.1)
    assert record["point_reaction"][2] > 0
    assert record["point_slip_increment"][0] > 0


@pytest.mark.slow
def test_contact_map(directory):
    """What is gathered to be drawn is the whole disc and all its forces, on any number of ranks."""
    punch = Punch(Parameters(case="B"), divisions=4, layers=2)
    record = punch.press(0.1)
    force = punch.contact.force()
    disc = gather(punch)
    assert (disc is None) == (COMM.rank != 0)
    if disc is None:
        return
    assert disc.x.shape == (89, 2) and disc.faces.shape == (80, 4)
    assert disc.area().sum() == pytest.approx(8 * 100 * np.sin(2 * np.pi / 16), rel=1e-12)
    assert disc.area().min() > 0  # faces are counter-clockwise
    assert disc.reaction.sum(axis=0) == pytest.approx(force, rel=1e-12, abs=1e-6)
    assert np.bincount(disc.status, minlength=3).tolist() == [
        record[status] for status in ("open", "stick", "slip")
    ]
    assert np.abs(np.hypot(*disc.rim().T) - 10).max() < 1e-12 and len(disc.rim()) == 16
    # zones are separated: no line within a zone, some between stick and slip
    assert record["stick"] and record["slip"] and len(disc.borders())
    alike = disc._replace(status=np.ones_like(disc.status))
    assert len(alike.borders()) == 0
    opened = disc._replace(status=np.zeros_like(disc.status), reaction=0 * disc.reaction)
    draw([("stick and slip", disc), ("open", opened)], "title", directory / "punch.png", (5, 5))
    assert (directory / "punch.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_command_line(directory, capsys):
    """The command writes the numbers, the picture and the fields, and says where they are; it draws its
    progress bar in a terminal alone."""
    numbers = directory / "numbers" / "punch.json"
    options = "--case A --loading 1 --unloading 2 --unload-to 0.05 --tol 1e-9".split()
    demo_punch.main([*options, "--json", str(numbers), "--output", str(directory)])
    COMM.Barrier()
    content = json.loads(numbers.read_text())
    head, steps = content["head"], content["steps"]
    assert head["case"] == "A" and head["ranks"] == COMM.size and head["unknowns"] == 5055
    assert head["contact_nodes"] == 337 and head["parameters"]["unload_to"] == 0.05
    assert all(head["versions"][name] for name in ("dolfinx", "petsc", "dolfinx_contact"))
    assert [step["displacement"] for step in steps] == pytest.approx([0.1, 0.075, 0.05])
    assert all(STEP_KEYS <= set(step) for step in steps)
    assert all(np.isfinite(step["error"]) and step["error"] <= 1e-9 for step in steps)
    for name, fields in {
        "body": "displacement stress von_Mises",
        "contact": "displacement reaction slip gap status pressure shear_traction dissipation",
    }.items():
        files = sorted((directory / "punch_data").glob(f"{name}*.vtu"))
        assert len(files) == 3
        assert all(f'Name="{field}"' in files[-1].read_text() for field in fields.split())
    assert (directory / "punch.png").stat().st_size > 50_000
    printed, progress = capsys.readouterr()
    assert not progress
    if COMM.rank == 0:
        for file in (numbers, directory / "punch.png", directory / "punch.pvd"):
            assert str(file) in printed
    else:
        assert not printed


def test_functions_sit_at_their_nodes():
    """Values at contact nodes become a Function with these values there, and zero elsewhere."""
    punch = Punch(Parameters(), divisions=4, layers=2)
    field = punch.contact.function(punch.contact.x[:, 0])
    x, R = ufl.SpatialCoordinate(punch.mesh), 10.0
    ds = ufl.Measure("ds", domain=punch.mesh, subdomain_data=punch.facet_tags)
    assert integral(punch.mesh, (field - x[0]) ** 2, ds(CONTACT)) < 1e-24 * R**4
    assert integral(punch.mesh, field**2, ds(TOP)) == 0


@pytest.mark.skipif(COMM.size > 2, reason="its thousands of small solves take minutes then")
def test_own_loop():
    """A loop written with ``dc.OwnLoop`` and plain DOLFINx finds ContactProblem's reactions."""
    assert demo_own_loop.compare("B", displacements=(0.1, 0.07)) < 1e-9
