# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Numbers in README and docs (benchmarks/quotes.py): marked ones are those of the JSON files, ratios are marked.

Covered: all that stands between markers in README.md and docs/*.md, and every ratio there, which has to be marked: what is
written as one, see RATIO.  Not covered: typed counts, settings and operation counts, and ratios said in other words.
"""

import json
import re
import shutil
import sys
from pathlib import Path
from random import Random

import pytest
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "benchmarks"))
import quotes
from quotes import ROOT

pytestmark = pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="files are the same on every rank")
COUNTS = "(?:two|three|four|five|six|seven|eight|nine|ten|twelve|dozen|twenty|thirty|fifty|hundred|thousand)"
PARTS = r"(?:a|one|two|three)\s(?:third|quarter|fifth|sixth|seventh|eighth|ninth|tenth|twentieth|hundredth|thousandth)s?"
ABOUT = r"(?:(?:about|some|nearly|almost|up to)\s)?"
RATIO = re.compile(
    rf"(?:\d|\b{COUNTS})\s*(?:times|×)|\d ?x\b(?! ?[\d(])|\b(?:twice|thrice|half|halves)\b|(?:\d|\b{COUNTS})-?fold\b"
    rf"|\d ?%|\bper ?cent\b|\bfactors?\sof\s{ABOUT}(?:\d|{COUNTS}\b)|\bby\s{ABOUT}{PARTS}\b"
    rf"|\b{PARTS}\s(?:as|of|less|more|faster|slower|shorter|longer|cheaper|fewer)\b",
    re.IGNORECASE,
)


def test_marked_texts_are_those_of_the_json():
    """Filling the markers anew changes no file; every source is quoted, and no marker is left open."""
    of, sources = quotes.texts(), set()
    for file in quotes.marked(ROOT):
        text = file.read_text()
        keys = [match[1] for match in quotes.MARKER.finditer(text)]
        assert text.count("<!--") == 2 * len(keys), file
        assert quotes.filled(text, of) == text, f"{file}: run python benchmarks/quotes.py"
        sources |= {key.split(".")[0] for key in keys}
    assert sources == {key.split(".")[0] for key in of}


def shaken(value, random):
    """The same JSON with every floating point number up to twice as large."""
    if isinstance(value, dict):
        return {key: shaken(of, random) for key, of in value.items()}
    if isinstance(value, list):
        return [shaken(of, random) for of in value]
    return value * (1 + random.random()) if isinstance(value, float) else value


def test_texts_follow_from_the_raw_numbers(tmp_path):
    """Other seconds in the JSON files give other ratios: what is quoted is computed, not kept (but for the study)."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    # Each by itself: numbers that one file gains change no other.
    for file in (tmp_path / "docs").rglob("*.json"):
        file.write_text(json.dumps(shaken(json.loads(file.read_text()), Random(6))))
    before, after = quotes.texts(ROOT), quotes.texts(tmp_path)
    for key in (
        "report.peers.siconos", "report.peers.getfem-0.over-ours", "report.ladder.frictionless",
        "report.growth.largest.over-elastic", "report.algebraic.A.return-over-newton", "elastic.table", "elastic.ranks",
        "elastic.worst-seconds", "solvers.study.table", "solvers.growth.table", "solvers.laws.table",
        "solvers.frictionless.table", "solvers.assembly.dense-over-blocks", "solvers.shares.table",
        "solvers.first-steps.table", "ferrari.ours", "report.stability.default.error",
        "variants.unloading.table", "variants.raised.table", "variants.two.table", "variants.block.work", "variants.agreement.nodal",
    ):  # fmt: skip
        assert after[key] != before[key], key


def test_counts_of_the_stress_matrix_are_those_of_its_outcomes(tmp_path):
    """An answer that is refused, or wrong, changes the table, the counts and the sentences; a part of the matrix has none."""
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    file = tmp_path / "docs/report/report.json"
    report = json.loads(file.read_text())
    data = report["sections"]["stability"]["data"]
    solved = [r for r in data["records"] if r["solver"] == "condensed" and r["outcome"] == "solved"]
    before = {key: int(quotes.texts(ROOT)[f"report.stability.condensed.{key}"]) for key in ("solved", "scenes")}  # fmt: skip
    solved[0]["outcome"], solved[1]["outcome"] = "refused", "WRONG"
    file.write_text(json.dumps(report))
    after = {key: text for key, text in quotes.texts(tmp_path).items() if "stability" in key}
    assert (
        int(after["report.stability.condensed.solved"]) == before["solved"] - 2 == len(solved) - 2
    )
    assert int(after["report.stability.condensed.scenes"]) == before["scenes"]
    assert (
        f"{before['solved'] - 2} / {before['scenes']}, 1 WRONG" in after["report.stability.table"]
    )
    assert (
        f"{solved[0]['group']}: {solved[0]['name']}" in after["report.stability.condensed.refused"]
    )
    assert after["report.stability.wrong"].startswith("1 answer")
    data["whole"] = False
    file.write_text(json.dumps(report))
    assert not [key for key in quotes.texts(tmp_path) if "stability" in key]


@pytest.mark.parametrize("file", quotes.marked(ROOT), ids=lambda file: file.name)
def test_ratios_are_marked(file):
    """No ratio stands in README.md and docs outside of markers."""
    text = file.read_text()
    left = quotes.MARKER.sub("", text)
    assert left != text
    found = [left[max(0, m.start() - 40) : m.end() + 20] for m in RATIO.finditer(left)]
    assert not found, found


@pytest.mark.parametrize("typed", [
    "takes 5.4 times as long", "3\ntimes", "ten times", "2.7 x faster", "within 2x of it", "twice", "10 × faster", "half of it",
    "tenfold", "by 20 %", "by a factor of about three", "a factor of 2.5", "a third less time", "two thirds of the cycles",
    "longer by a quarter",
])  # fmt: skip
def test_ratios_are_found(typed):
    """The ways in which ratios are written down are seen."""
    assert RATIO.search(typed)


@pytest.mark.parametrize("plain", [
    "1.5 s", "a 3 x 3 matrix", "8 x (8 + 1) numbers", "three cases", "16 digits", "the third step", "one step after another",
    "25 of 25 stick", "a manifold", "at 1e-10", "by a fourth start",
])  # fmt: skip
def test_counts_are_no_ratios(plain):
    """Counts, sizes and settings may be typed."""
    assert not RATIO.search(plain)


def test_markers_are_filled(tmp_path):
    """What stands between markers is replaced, inline and on lines of its own; a marker without a number is an error."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("<!-- a.b -->2<!-- end --> times\n<!-- a.c -->\n1\n<!-- end -->\n")  # fmt: skip
    of = {"a.b": "3", "a.c": "| 4 |\n| 5 |"}
    assert quotes.fill(tmp_path, of) == [tmp_path / "README.md"]
    assert (tmp_path / "README.md").read_text() == (
        "<!-- a.b -->3<!-- end --> times\n<!-- a.c -->\n| 4 |\n| 5 |\n<!-- end -->\n"
    )
    assert quotes.fill(tmp_path, of) == []
    with pytest.raises(KeyError):
        quotes.fill(tmp_path, {"a.b": "3"})
