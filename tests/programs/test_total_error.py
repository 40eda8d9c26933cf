# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The report's figure of total error against seconds: drawn from its record alone, and peers measured as we are."""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
from benchmarks.peers import best
from benchmarks.peers.compare import told
from benchmarks.report import __main__ as report
from benchmarks.report import total
from studies.punch.limits import LIMITS, build, graded
from studies.punch.model import programme

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="arrays and whole programs")
RECORD = Path(__file__).resolve().parents[2] / "notes" / "records" / "report-2026-11-28.json"


@pytest.fixture(scope="module")
def record():
    """The committed section."""
    return json.loads(RECORD.read_text())["sections"]["total"]


def points(figure) -> set:
    """All that is drawn, as title of the panel, seconds and error."""
    return {
        (ax.get_title(), float(x), float(y))
        for ax in figure.axes
        for line in ax.lines
        for x, y in np.transpose(line.get_data())
        if np.isfinite(y)
    }


def test_every_point_is_a_row_of_the_record(record):
    """Each row is drawn once in each panel in which it has an error, at its seconds; nothing else is drawn."""
    data = record["data"]
    told = {
        (f"{row['case']}: {title}", row["seconds"], max(row[f"{key}_error"], total.LEAST))
        for row in data["rows"]
        for key, title in total.QUANTITIES.items()
        if row.get(f"{key}_error") is not None
    }
    assert points(total.figure(data)) == told and len(told) > 100
    moved = copy.deepcopy(data)
    moved["rows"][0]["seconds"] *= 2
    assert len(points(total.figure(moved)) - told) >= 3


def test_errors_are_those_of_the_limits(record):
    """Relative to the limits of the study, which the record has, too; it says when and by which commit it was made."""
    for row in record["data"]["rows"]:
        value, _ = LIMITS[row["case"]]["dissipation"]
        assert row["dissipation_error"] == pytest.approx(abs(row["dissipation"] - value) / value)
    for case, limits in LIMITS.items():
        for key, known in limits.items():
            assert tuple(record["data"]["limits"][case][key]) == known
    assert all(re.fullmatch(r"\d{4}-\d\d-\d\d, \w+\+?", when) for when in record["measured"])


def test_a_broken_record_shows(record):
    """A row that lacks a number is refused by name; what failed, did not end or is absent stands on the page."""
    row = {key: value for key, value in record["data"]["rows"][0].items() if key != "dissipation"}
    with pytest.raises(ValueError, match="lacks.*dissipation"):
        total.evaluate({"total/one": [row]})
    without = copy.deepcopy(record["data"])
    del without["limits"]["A"]
    with pytest.raises(KeyError):
        total.figure(without)
    stopped = dict(
        peer="one", case="A", divisions=2, increments=15, done=3, said="stopped after 3 s"
    )
    data = total.evaluate(
        {"a": record["data"]["rows"], "b": stopped, "c": dict(absent="two is absent")}
    )
    shown = str(list(total.tables(data)))
    assert "stopped after 3 s" in shown and "two is absent" in shown
    lost = dict(record, failed={"total/one": "killed"}, not_run=["total/two"])
    page = " ".join(report.remarks(lost, {}))
    assert "killed" in page and "total/two" in page


def test_sections_of_an_older_report_stay(record):
    """What is not measured again is taken over with its machine, in the order of the page."""
    old = dict(
        machine=dict(cores=1), sections=dict(growth=dict(title="growth"), total=dict(title="old"))
    )
    new = report.joined(old, dict(machine=dict(cores=2), sections=dict(total=record)))
    assert list(new["sections"]) == ["total", "growth"] and new["sections"]["total"] is record
    assert new["sections"]["growth"]["machine"] == dict(cores=1) and new["machine"] == dict(cores=2)
    said = " ".join(report.remarks(record | dict(machine=dict(cores=1)), new["machine"]))
    assert "cores 1" in said and "cores 1" not in " ".join(report.remarks(record, new["machine"]))


@pytest.mark.parametrize("order", (1, 2))
def test_displacements_are_worth_what_the_problem_says(order):
    """Forces, pressure and work of friction from displacements alone, here our own, are those of the problem."""
    punch, _ = build(graded(2, order=order), tol=1e-11)
    punch.restart()
    given, found = told(punch), []
    for number, displacement in enumerate(programme(punch.parameters), start=1):
        record = punch.press(displacement)
        found.append(punch.u.x.array.reshape(-1, 3).copy())
        if number == punch.parameters.loading:
            loaded = record
    work = punch.dissipation()
    of = best.worth(punch, given, found, None, order + 1)
    assert of["normal"] == pytest.approx(loaded["normal_reaction"], rel=1e-8)
    assert of["tangential"] == pytest.approx(loaded["tangential_reaction_sum"], rel=1e-7)
    assert of["dissipation"] == pytest.approx(work, rel=1e-6)


def test_middles_of_bricks_of_20_nodes():
    """Their shape functions reproduce quadratic displacements on a box, and hand on all of a force and of its moment."""
    z, y, x = np.meshgrid([0, 1, 3], [-2, 0, 2], [1, 2, 3], indexing="ij")
    x = np.column_stack([x.ravel(), y.ravel(), z.ravel()]).astype(float)
    x[x[:, 2] == 1, 2] = 1.5
    found = best.middles(np.arange(27)[None])
    assert sorted(found) == [4, 10, 12, 13, 14, 16, 22]
    of = 1 + x[:, 0] * x[:, 1] - x[:, 2] ** 2 + x[:, 0] * x[:, 1] * x[:, 2] + x[:, 1] ** 2
    for node, weights in found.items():
        assert sum(w * of[k] for k, w in weights) == pytest.approx(of[node])
        assert not {k for k, _ in weights} & set(found)
        np.testing.assert_allclose(sum(w * x[k] for k, w in weights), x[node], atol=1e-12)
