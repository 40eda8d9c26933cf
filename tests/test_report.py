# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The report (benchmarks/report.py): complete, self-contained, resumable; what the docs quote is from it."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import elastic_ratio
import report
from report_claims import claims, fill, found
from report_run import Measurement, compute, current, stored

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="starts processes of its own")
ROOT = Path(__file__).resolve().parent.parent
COMMITTED = ROOT / "docs" / "report" / "report.json"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Directory of the smallest report of all sections."""
    directory = tmp_path_factory.mktemp("report")
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
    assert of["claims"] == claims(of["sections"])
    for row in of["sections"]["algebraic"]["data"]["rows"]:
        for solver, curve in row["curves"].items():
            assert len(curve["error"]) == len(curve["seconds"]) > 1, solver
    singular = of["sections"]["stability"]["data"]
    assert singular["singular_refused"] == singular["singular"] > 0 and singular["third_state"] == 0


def test_page_is_self_contained(made):
    """All figures are in the page, each with its sentence; nothing in it is fetched from elsewhere."""
    page = (made / "report.html").read_text()
    figures = json.loads((made / "report" / "report.json").read_text())["figures"]
    assert set(figures) == {file.stem for file in (made / "report").glob("*.svg")}
    assert page.count("<svg") == len(figures) >= 5
    for sentence in figures.values():
        assert sentence.endswith(".") and "nan" not in sentence.split()
    assert not re.search(r"<(link|script|iframe|img)\b", page)
    links = re.findall(r"""(?:src|href)=["']([^"']*)|url\(([^)]*)\)""", page)
    links = {a or b for a, b in links if not a.startswith("data:image/png;base64,")}
    assert links and all(link.startswith("#") for link in links)
    ids = re.findall(r'\bid="([^"]*)"', page)
    assert {link[1:] for link in links} <= set(ids) and len(ids) == len(set(ids))


def test_a_stopped_report_continues(made, tmp_path):
    """A measurement is made once for its settings and code; one that failed is kept as such and tried again."""
    file = next((made / "measurements").glob("*/*.json"))
    before = file.stat().st_mtime_ns
    good = Measurement("one", "report_run:ladder", dict(first=1, last=2))
    assert stored(good, tmp_path) is None
    record = compute(good, tmp_path)
    assert stored(good, tmp_path) == record and len(record["result"]) == 2
    assert current(record) and "benchmarks/report_run.py" in record["made_with"]
    assert not current(record | dict(made_with={"benchmarks/report_run.py": "of another day"}))
    assert stored(replace(good, settings=dict(first=1, last=3)), tmp_path) is None
    bad = Measurement("two", "report_run:ladder", dict(first=1))
    assert "last" in compute(bad, tmp_path)["failed"] and stored(bad, tmp_path) is None
    assert file.stat().st_mtime_ns == before
    found = report.run({"section": [bad, good]}, tmp_path, minutes=-1.0)
    assert found == {"section": {"two": None, "one": record}}


def test_markers_are_filled_from_the_claims(tmp_path):
    """What stands between markers is replaced; a marker without a measurement is an error."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("<!-- report:a.b -->2<!-- /report --> times\n")
    assert fill(tmp_path, {"a.b": "3"}) == [tmp_path / "README.md"]
    assert [entry[1:] for entry in found(tmp_path)] == [("a.b", "3")]
    assert fill(tmp_path, {"a.b": "3"}) == []
    with pytest.raises(KeyError):
        fill(tmp_path, {})


def test_ratios_in_the_docs_are_those_of_the_committed_report():
    """Every number between markers is a claim of docs/report/report.json, and those follow from its data."""
    markers = found(ROOT)
    if not COMMITTED.exists():
        assert not markers
        return
    of = json.loads(COMMITTED.read_text())
    assert of["claims"] == claims(of["sections"])
    assert markers
    for file, key, text in markers:
        assert text == of["claims"][key], (file.name, key)


def test_elastic_ratios_in_the_docs_are_those_of_the_committed_records():
    """The table of docs/method.md is written from docs/elastic_ratio.json, not typed."""
    text = (ROOT / "docs" / "method.md").read_text()
    records = json.loads((ROOT / "docs" / "elastic_ratio.json").read_text())
    assert elastic_ratio.with_table(text, records) == text
    assert elastic_ratio.with_table(text, records[:-1]) != text
