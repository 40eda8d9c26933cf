# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The report (python -m benchmarks.report): complete, self-contained, resumable."""

import json
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
from benchmarks import measurement
from benchmarks.measurement import Measurement, compute, current, stored
from benchmarks.peers import compare
from benchmarks.report import __main__ as report

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts processes of its own"),
]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Directory of the smallest report of all sections.

    All but one of its measurements are done in this process, which has imported DOLFINx already; that they have processes
    of their own is looked at below.
    """
    directory = tmp_path_factory.mktemp("report")
    process = subprocess.run

    def started(command, **options):
        if "benchmarks.measurement" not in map(str, command):
            return process(command, **options)
        measurement.measure(*map(str, command[3:]))
        return subprocess.CompletedProcess(command, 0, "", "")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subprocess, "run", started)
        report.main(["--size", "smallest", "--measurements", str(directory / "measurements"),
            "--output", str(directory)])  # fmt: skip
    return directory


def test_json_is_complete(made):
    """Every section was measured, none of it failed, and it says where, when, by what and at which load."""
    of = json.loads((made / "report" / "report.json").read_text())
    assert set(of["sections"]) == set(report.SECTIONS)
    for name, section in of["sections"].items():
        assert section["data"] and not section["failed"] and not section["not_run"], (name, section)
        assert section["load"][0] is not None and section["measured"]
    for key in ("processor", "cores", "compiler", "dolfinx", "petsc", "dolfinx_contact", "commit"):
        assert of["machine"][key], key
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", of["date"])
    repeated = of["sections"]["ladder"]["data"]["rows"][0]["step"]
    assert repeated["repetitions"] >= 1 and repeated["least"] <= repeated["median"] <= repeated["largest"]  # fmt: skip
    for row in of["sections"]["algebraic"]["data"]["rows"]:
        for solver, curve in row["curves"].items():
            assert len(curve["error"]) == len(curve["seconds"]) > 1, solver
    singular = of["sections"]["stability"]["data"]
    assert singular["singular_refused"] == singular["singular"] > 0 and singular["third_state"] == 0


def test_page_is_self_contained(made):
    """All figures are in the page, each with its caption; nothing in it is fetched from elsewhere."""
    page = (made / "report.html").read_text()
    figures = json.loads((made / "report" / "report.json").read_text())["figures"]
    assert set(figures) == {file.stem for file in (made / "report").glob("*.svg")}
    assert page.count("data:image/svg+xml;base64,") == page.count("<img") == len(figures) >= 5
    for caption in figures.values():
        assert caption.endswith(".") and "nan" not in caption.split()
    assert not re.search(r"<(link|script|iframe)\b|url\(", page)
    links = re.findall(r"""(?:src|href)=["']([^"']*)""", page)
    assert links and all(link.startswith("data:image/svg+xml;base64,") for link in links)


def test_a_stopped_report_continues(made, tmp_path):
    """A measurement is made once for its settings and code; one that failed is kept as such and tried again."""
    file = next((made / "measurements").glob("*/*.json"))
    before = file.stat().st_mtime_ns
    good = Measurement("one", "benchmarks.measurement:ladder", dict(first=1, last=2))
    assert stored(good, tmp_path) is None
    record = compute(good, tmp_path)
    assert stored(good, tmp_path) == record and len(record["result"]) == 2
    assert current(record) and "benchmarks/measurement.py" in record["made_with"]
    assert not current(record | dict(made_with={"benchmarks/measurement.py": "of another day"}))
    assert stored(replace(good, settings=dict(first=1, last=3)), tmp_path) is None
    bad = Measurement("two", "benchmarks.measurement:ladder", dict(first=1))
    assert "last" in compute(bad, tmp_path)["failed"] and stored(bad, tmp_path) is None
    assert file.stat().st_mtime_ns == before
    found = report.run({"section": [bad, good]}, tmp_path, minutes=-1.0)
    assert found == {"section": {"two": None, "one": record}}


def test_a_peer_is_judged_by_our_error():
    """Displacements that somebody else has found, here our own at 1e-11, have our error and our forces."""
    increments, mesh = [1, 2], dict(divisions=2, layers=2)
    ours, punch = (compare.case_a(0, increments, mesh, tol=1e-11) for _ in range(2))
    given = compare.told(punch)
    found = []
    for displacement in given["programme"]:
        ours.press(displacement)
        found.append(ours.u.x.array.reshape(-1, 3).copy())
    result = compare.compared(punch, given, found, 1.0, 0, increments, mesh)
    assert result["done"] == result["steps"] == 3 and max(result["errors"]) < 1e-10
    assert np.max(result["force_error"]) < 1e-6
    assert compare.evaluate({"peers/one": result | dict(peer="one", setting="", said="", own=[])})["rows"][0]["ratio"] > 0  # fmt: skip
    found[0][0, 0] += 1e-4
    assert compare.compared(compare.case_a(0, increments, mesh), given, found, 1.0, 0, increments, mesh)["errors"][0] > 1e-3  # fmt: skip
