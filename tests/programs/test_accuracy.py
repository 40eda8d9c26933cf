# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch to an accuracy that is asked for: its curved and graded mesh, the disc that is drawn, the estimate, the command."""

import json
import shutil
import tempfile
from pathlib import Path

import dolfinx_contact as dc  # noqa: F401  before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
import demo_punch

from studies.punch import Parameters, Punch
from studies.punch.accuracy import (
    Found,
    NotAccurate,
    accurate,
    difference,
    extrapolated,
    mesh_options,
    smaller_increments,
)
from studies.punch.contact_map import gather
from studies.punch.limits import LIMITS
from studies.punch.mesh import CONTACT, punch_mesh

COMM = MPI.COMM_WORLD


@pytest.fixture
def directory():
    """A directory that all ranks share."""
    made = Path(COMM.bcast(tempfile.mkdtemp() if COMM.rank == 0 else None))
    yield made
    COMM.Barrier()
    if COMM.rank == 0:
        shutil.rmtree(made)


@pytest.mark.parametrize("divisions, parts", [(2, 1), (3, 1), (4, 1), (4, 4)])
def test_the_rim_is_a_circle(divisions, parts):
    """The disc of second order has the circle's area to the fourth order, 5e-5 with four divisions, in any unit."""
    options = mesh_options(divisions) | dict(quarter=parts > 1)
    punch = punch_mesh(COMM, radius=3e-6, height=1e-6, **options)
    ds = ufl.Measure("ds", domain=punch.mesh, subdomain_data=punch.facet_tags)
    area = COMM.allreduce(
        fem.assemble_scalar(fem.form(fem.Constant(punch.mesh, 1.0) * ds(CONTACT)))
    )
    assert abs(parts * area / (np.pi * 9e-12) - 1) < 5.1e-5 * (4 / divisions) ** 4


def test_cells_shrink_towards_the_rim():
    """The outermost quadrilaterals are as wide as asked for, the next ones wider by the same factor."""
    punch = punch_mesh(COMM, radius=1.0, divisions=4, layers=1, rim=0.05)
    x = punch.mesh.geometry.x[punch.mesh.geometry.x[:, 2] == 0]
    diagonal = np.concatenate(COMM.allgather(x[np.isclose(x[:, 0], x[:, 1]) & (x[:, 0] > 0)]))
    distance = np.unique(np.linalg.norm(diagonal, axis=1).round(9))
    spoke = distance[-5:]
    widths = np.diff(spoke) / (spoke[-1] - spoke[0])
    assert widths[-1] == pytest.approx(0.05, rel=1e-6)
    assert widths[:-1] / widths[1:] == pytest.approx(widths[0] / widths[1], rel=1e-6)
    with pytest.raises(ValueError, match="rim must be less than a 4th"):
        punch_mesh(COMM, divisions=4, layers=1, rim=0.3)


def test_a_quarter_is_the_whole():
    """Forces, work and what is at P are those of the whole punch, and so they are after a restart with another case."""
    parameters = Parameters(case="C", lowest=0.6, loading=1, unloading=2)
    whole, quarter = (Punch(parameters, quarter=part, **mesh_options(2)) for part in (False, True))
    with pytest.raises(ValueError, match="divisions must be even for a quarter, got 3"):
        punch_mesh(COMM, quarter=True, **mesh_options(3))
    for case in "CA":
        whole.restart(case=case), quarter.restart(case=case)
        for displacement in (0.1, 0.06, 0.02):
            a, b = whole.press(displacement), quarter.press(displacement)
            for name in ("normal_reaction", "tangential_reaction_sum", "point_slip_increment"):
                assert b[name] == pytest.approx(a[name], rel=1e-6, abs=1e-9), name
        assert quarter.dissipation() == pytest.approx(whole.dissipation(), rel=1e-6)


def test_the_drawn_disc():
    """Faces of nine nodes are drawn as four: all area, counter-clockwise, and the nodal areas of the contact."""
    punch = Punch(Parameters(case="A", lowest=0.6), **mesh_options(2))
    record, disc = punch.press(0.1), gather(punch)
    total = COMM.allreduce(punch.contact.area.sum())
    if disc is None:
        return
    assert disc.x.shape == (89, 2) and disc.faces.shape == (80, 4)
    assert len(np.unique(disc.faces)) == 89
    assert disc.area().sum() == pytest.approx(total, rel=1e-12)
    drawn = disc._replace(nodal_area=None).area()
    polygon = 800 * np.sin(2 * np.pi / 16)
    assert drawn.min() > 0 and drawn.sum() == pytest.approx(polygon, rel=1e-9)
    assert disc.mean_pressure() == pytest.approx(record["normal_reaction"] / total, rel=1e-12)


def test_differences_are_taken_at_common_steps():
    """Runs with more increments are compared at the steps of the coarser one, forces over the largest."""

    def of(forces, work):
        records = [{"normal_reaction": f, "tangential_reaction_sum": 0.1 * f} for f in forces]
        return Found(None, records, [], work)

    coarse, fine = of([50.0, 100.0, 20.0], 8.0), of([9, 50.0, 9, 101.0, 9, 22.0], 10.0)
    assert difference(coarse, fine) == pytest.approx((0.2, 2 / 100))
    assert difference(fine, coarse) == pytest.approx((0.2, 2 / 101))


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_powers_of_the_increment_are_extrapolated_to_their_limit(order):
    """Three values 7 + c h^order give 7; two give 7 for the first order; a constant stays; erratic values stay near the last."""
    values = [7 + 3 * 2.0 ** (-order * k) for k in range(4)]
    assert extrapolated(values[:3])[0] == pytest.approx(7, rel=1e-12)
    assert extrapolated(values) == (pytest.approx(7, rel=1e-12), pytest.approx(0, abs=1e-12))
    first = [7 + 3 * 2.0**-k for k in range(2)]
    assert extrapolated(first) == (pytest.approx(7, rel=1e-12), pytest.approx(1.5))
    assert extrapolated([2.0, 2.0, 2.0]) == (2.0, 0.0)
    assert extrapolated([2.0, 2.0, 3.0])[0] == 4.0 and extrapolated([2.0, 3.0, 3.0])[0] == 3.0


def test_forces_decide_the_increments_of_the_steps_and_work_is_extrapolated():
    """Forces that halved increments change too much have theirs halved; the work gets what the rest would change."""

    def at(k):
        force = 100 + 8 * 4.0**-k
        records = [{"normal_reaction": force, "tangential_reaction_sum": 1.0}] * 2**k
        return Found(None, records, [], 10 + 2.0**-k)

    halvings, change, work, forces = smaller_increments(at, 0.05)
    assert halvings == 1 and change == pytest.approx(-0.5) and work <= 1e-12
    assert forces == pytest.approx(2 * (8 / 4 - 8 / 16) / (100 + 8 / 4), rel=0.02)


@pytest.mark.parametrize("case", LIMITS)
def test_accuracy_that_is_asked_for(case):
    """The work of friction is within the estimate of its limit, and the estimate within what was asked."""
    found = accurate(Parameters(case=case, tol=1e-8), 0.05)
    limit, width = LIMITS[case]["dissipation"]
    assert found.error <= 0.05
    assert abs(found.dissipation - limit) <= found.dissipation_error * limit + width
    assert found.tried[-1][:2] == (4, 1) and len(found.tried) == 3
    assert found.dissipation == pytest.approx(
        found.punch.dissipation() + found.increments, rel=1e-12
    )


def test_accuracy_is_a_part():
    """An accuracy that is no part of one is refused."""
    with pytest.raises(ValueError, match="accuracy must be between 0 and 1"):
        accurate(Parameters(), 1.0)


def test_what_cannot_be_reached_is_said(monkeypatch):
    """With the finest mesh used up the best run comes with the failure."""
    monkeypatch.setattr("studies.punch.accuracy.DIVISIONS", (2, 4))
    monkeypatch.setattr("studies.punch.accuracy.HALVINGS", 0)
    few = Parameters(case="A", tol=1e-8, loading=1, unloading=1)
    with pytest.raises(NotAccurate, match="more than 0.001") as caught:
        accurate(few, 1e-3)
    assert caught.value.found.error > 1e-3 and len(caught.value.found.records) == 2


@pytest.mark.slow
def test_command(directory, capsys):
    """``--accuracy`` writes work, estimated errors and seconds beside the steps, and the picture."""
    options = "--case A --loading 1 --unloading 2 --accuracy 0.2 --tol 1e-8".split()
    demo_punch.main([*options, "--output", str(directory)])
    COMM.Barrier()
    content = json.loads((directory / "punch.json").read_text())
    assert 0 < content["dissipation_error"] <= 0.2 and 0 < content["force_error"] <= 0.2
    assert (
        content["dissipation"] > 0 and content["seconds"] > 0 and content["processor_seconds"] > 0
    )
    assert len(content["steps"]) % 3 == 0 and content["head"]["unknowns"] == 4947
    assert (directory / "punch.png").stat().st_size > 50_000
    printed = capsys.readouterr().out
    assert bool(printed) == (COMM.rank == 0) and ("estimated error" in printed) == (COMM.rank == 0)
