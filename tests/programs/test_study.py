# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The study of the punch: what it writes, its energy balance, its measures, and that it resumes."""

import csv
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import dolfinx_contact  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
from mpi4py import MPI

pytest.importorskip("gmsh")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")
from studies import page
from studies.punch import Parameters, Punch, programme
from studies.punch import __main__ as study_punch
from studies.punch.contact_map import ContactMap, gather, mirrored
from studies.punch.measures import hysteresis, plateau, zones
from studies.punch.run import EnergyBalance, Run, compute
from studies.punch.work import TERMS, comparison

COMM = MPI.COMM_WORLD
ALONE = COMM.size == 1
ROOT = Path(__file__).parents[2]
COARSE = ["--divisions", "2", "--layers", "1", "--cycles", "2"]
FIGURES = "fig3 fig4 fig5 fig6 fig7 fig4_node1 fig7_node1 unloading1 unloading_last".split()
FIGURES += "dissipation wear cycles energy".split() + ["convergence"] * ALONE


@pytest.fixture(scope="module")
def study():
    """Directory of a coarse study, shared by all ranks; on one rank with all variants."""
    made = tempfile.mkdtemp() if COMM.rank == 0 else None
    directory = Path(COMM.bcast(made))
    options = "--point 4 4 --point 9 1".split()
    if ALONE:
        options += "--explore --explore-cycles 2 --explore-unload-to 0".split()
    study_punch.main([*COARSE, *options, "--output", str(directory)])
    COMM.barrier()
    yield directory
    COMM.barrier()
    if COMM.rank == 0:
        shutil.rmtree(directory)


def rows(file):
    with open(file, newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.slow
def test_study_writes_everything(study):
    """Each figure exists as SVG and PNG with its data as CSV, and the page has all, by itself."""
    for name in FIGURES:
        stem = study / "figures" / name
        assert "<svg" in stem.with_suffix(".svg").read_text()[:1000], name
        assert stem.with_suffix(".png").read_bytes().startswith(b"\x89PNG"), name
        assert len(rows(stem.with_suffix(".csv"))) > 3, name
    page = (study / "study.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == len(list((study / "figures").glob("*.svg")))
    assert not re.findall(r'src="(?!data:)', page)
    linked = re.findall(r'href="([^"]*)"', page)
    assert linked and all((study / name).exists() for name in linked)
    assert (
        '<td class="text">unload to</td><td class="text">0.02</td>' in page
    )  # other rows of that column are words


@pytest.mark.slow
def test_numbers_of_the_page_are_those_of_the_files(study):
    """Work per cycle is the same in history, CSV and page, and so is the worn volume."""
    page = (study / "study.html").read_text()
    for row in rows(study / "figures" / "cycles.csv"):
        table = Run(study / "runs" / "base" / row["case"]).table
        ends = np.r_[0, table["contact0_dissipation"][14::15]]
        work = float(row["dissipation_Nmm"])
        assert work == pytest.approx(np.diff(ends)[int(row["cycle"]) - 1], rel=1e-9)
        assert f"<td>{work:.4g}</td>" in page
        assert float(row["worn_volume_mm3"]) == pytest.approx(3e-8 * work, rel=1e-12)
    depths = rows(study / "figures" / "wear.csv")
    for case in "ABC":
        volume = sum(float(r["depth_nm"]) * 1e-6 * float(r["area"]) for r in depths if r["case"] == case)  # fmt: skip
        mine = [r for r in rows(study / "figures" / "cycles.csv") if r["case"] == case]
        assert volume == pytest.approx(sum(float(r["worn_volume_mm3"]) for r in mine), rel=1e-9)


def closes(table, needed):
    """The identity closes in every step with all its terms, and not without one of those needed."""
    terms = {name: table[name] for name in TERMS if name != "work_of_friction"}
    largest = np.abs([table["platen_work"], *terms.values()]).max(axis=0)
    left = table["platen_work"] - sum(terms.values())
    assert (np.abs(left) <= 1e-9 * largest).all()
    assert (np.abs(table["residual_mean"]) <= 1e-9 * largest).all()
    for name in needed:
        assert (np.abs(left + terms[name]) > 1e-4 * largest).any(), name
    for name in ("half_du_K_du", "dissipation_end", "closing"):
        assert (terms[name] >= -1e-9 * largest).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["base"] + ["unload_to_0_mm", "top_free"] * ALONE)
def test_energy_balance_closes(study, variant):
    """Work of the platen = change of elastic energy + dissipation + what the scheme adds."""
    for case in "ABC":
        table = Run(study / "runs" / variant / case).table
        closes(table, ["elastic_change", "dissipation_end", "half_du_K_du"])


def test_energy_balance_of_a_punch_that_opens_and_closes():
    """A punch that is lifted off and set down again: the closing nodes have their term."""
    punch = Punch(Parameters(case="C"), divisions=2, layers=1)
    balance, table = EnergyBalance(punch), []
    for displacement in (0.05, 0.1, -0.02, 0.06, 0.1):
        balance.open()
        punch.press(displacement)
        table.append(balance.close())
    assert table[3]["closing"] > 0.0
    table = {name: np.array([row[name] for row in table]) for name in table[0]}
    closes(table, ["elastic_change", "dissipation_end", "half_du_K_du", "closing"])


@pytest.mark.slow
def test_every_statement_is_decided_by_the_data(study):
    """Verdicts follow from the answers of single runs, and every run was asked."""
    answers = rows(study / "figures" / "answers.csv")
    verdicts = rows(study / "figures" / "statements.csv")
    assert len(verdicts) == len({row["statement"] for row in answers}) > 15
    asked = {row["variant"] for row in answers}
    assert asked == {row["variant"] for row in rows(study / "figures" / "variants.csv")}
    if ALONE:
        assert {"base", "top free", "unload to 0 mm", "mesh refined 1x"} <= asked
    for verdict in verdicts:
        parts = re.findall(r"(\d+)/(\d+)", verdict["runs in which it holds"])
        held, of = (sum(int(part[k]) for part in parts) for k in (0, 1))
        expected = "holds in all" if held == of else "depends" if held else "holds in none"
        assert verdict["verdict"] == expected


def test_lists_in_tables_are_short():
    """A list of numbers is shown to four digits, what is rounding beside its largest entry as zero."""
    assert ">5.193, -1, 0<" in page.table([{"point": [5.192815424335428, -1, 1.7e-16]}])


def test_columns_of_words_begin_at_the_left_and_long_tables_are_folded():
    """A title stands above its column, a cell without a value too; a table of many rows is shown when asked for."""
    rows = [{"solver": "Newton", "s": 1.5}, {"solver": "", "s": None}]
    words, number = '<td class="text">', "<td>"
    shown = page.table(rows)
    assert '<th class="text">solver</th><th>s</th>' in shown
    assert (
        f"{words}Newton</td>{number}1.5</td>" in shown and f"{words}–</td>{number}–</td>" in shown
    )
    assert "<details>" not in shown
    assert "<summary>Table of 40 rows</summary>" in page.table(20 * rows)


@pytest.mark.skipif(not ALONE, reason="one rank says it all")
def test_variant_that_fails_is_in_the_table(tmp_path, monkeypatch):
    """A step that does not converge ends its run, not the study, is named, and is not tried again."""
    solve, tried = dolfinx_contact.ContactProblem.solve, []

    def hobbled(problem):
        if problem.tol == 1e-11:
            tried.append(problem)
            problem.solver = dolfinx_contact.FixedPoint(max_iterations=1)
        return solve(problem)

    monkeypatch.setattr(dolfinx_contact.ContactProblem, "solve", hobbled)
    short, mesh = dict(case="A", loading=1, unloading=1), dict(divisions=2, layers=1)
    runs = {
        "base": {"A": Parameters(**short)},
        "too exact": {"A": Parameters(**short, tol=1e-11)},
    }
    for _ in range(2):
        complete, failures = study_punch.compute_all(runs, tmp_path, [], mesh)
        assert [failure["variant"] for failure in failures] == ["too exact"]
        assert list(complete) == ["base"] and len(tried) == 1
        table = comparison(complete, failures)
        assert [bool(row["not_converged"]) for row in table] == [False, True]
        assert table[1]["not_converged"].startswith("step 1: not converged: error")
        assert np.isnan(table[1]["first_cycle_Nmm"])


def strip(status, slip=None):
    """A run of one step on a strip of squares, two nodes wide, whose upper row has these statuses."""
    n = len(status)
    x = np.array([(k, row) for row in (0.0, 1.0) for k in range(n)]) - ((n - 1) / 2, 0)
    faces = np.array([(k, k + 1, n + k + 1, n + k) for k in range(n - 1)])
    status = np.r_[np.full(n, 2), status]
    slip = np.zeros((2 * n, 2)) if slip is None else slip
    disc = ContactMap(x, faces, np.ones((2 * n, 3)), slip, status, np.zeros(2 * n))
    parameters = SimpleNamespace(radius=np.linalg.norm(x, axis=1).max())
    return SimpleNamespace(disc=lambda step: disc, area=np.ones(2 * n), parameters=parameters)


def test_zones_are_pieces_connected_by_edges():
    """Stick zones are counted by edges of faces; nodes across a diagonal are not neighbours."""
    assert zones(strip([2, 2, 2, 2, 2]), 1).count == 0
    assert zones(strip([1, 1, 2, 1, 2]), 1).count == 2
    assert zones(strip([1, 1, 1, 1, 1]), 1).count == 1
    diagonal = strip([2, 2, 1, 2, 2])
    diagonal.disc(1).status[1] = 1  # below and beside it
    assert zones(diagonal, 1).count == 2
    assert zones(diagonal, 1).fraction == pytest.approx(0.2)
    assert np.isnan(zones(diagonal, 1).inner)
    run = strip([2, 2, 2, 2, 2])
    run.disc(1).slip_increment[0] = (0.1, 0)  # from the left end to the middle
    assert zones(run, 1).inner == pytest.approx(2 / np.hypot(2, 1))


@pytest.mark.skipif(not ALONE, reason="maps of whole programs")
@pytest.mark.parametrize("order", (1, 2))
def test_mirrored_quarter_is_the_whole_disc(order):
    """The map of a quarter, mirrored, has status where it is clear, slip and force per area of the whole punch."""
    discs = []
    for quarter in (False, True):
        mesh = dict(divisions=2, layers=2, order=order, quarter=quarter)
        punch = Punch(Parameters(case="C", loading=2, unloading=3, tol=1e-11), **mesh)
        for displacement in programme(punch.parameters)[:4]:
            punch.press(displacement)
        discs.append(gather(punch))
    whole, found = discs[0], mirrored(discs[1])
    at = np.linalg.norm(found.x[:, None] - whole.x[None], axis=2)
    node = at.argmin(axis=1)
    assert at.min(axis=1).max() < 1e-6 and set(node) == set(range(len(whole.x)))
    assert len(found.faces) == len(whole.faces)
    clear = np.abs(whole.load_function[node]) > 1e-5 * np.abs(whole.load_function).max()
    assert (found.status[clear] == whole.status[node][clear]).all() and len(
        set(whole.status[node][clear])
    ) >= 1
    scale = np.abs(whole.reaction).max()
    areas = found.area()[:, None], whole.area()[node, None]
    np.testing.assert_allclose(
        found.reaction / areas[0], whole.reaction[node] / areas[1], atol=1e-5 * scale
    )
    np.testing.assert_allclose(
        found.slip_increment,
        whole.slip_increment[node],
        atol=1e-5 * np.abs(whole.slip_increment).max(),
    )
    assert found.mean_pressure() == pytest.approx(whole.mean_pressure(), rel=1e-6)
    corners = found.x[found.faces]
    edge = np.roll(corners, -1, axis=1) - corners
    assert (
        edge[:, :, 0] * np.roll(edge, -1, axis=1)[:, :, 1]
        > edge[:, :, 1] * np.roll(edge, -1, axis=1)[:, :, 0]
    ).all()


def curve(force, slip, loading):
    """A run of one cycle with a given force-slip curve."""
    zero = np.zeros(len(slip))
    table = dict(zip(("contact0_force_z", "node0_displacement_t1"), map(np.array, (force, slip))))
    table["node0_displacement_t2"] = zero
    return SimpleNamespace(
        table=table, loaded=lambda c: loading, unloaded=lambda c: len(slip) if c else 0
    )


def test_plateau_and_hysteresis_of_known_curves():
    """A straight way up and back has neither; a point that waits at the peak waits after it."""
    straight = curve([1, 2, 1, 0], [1, 2, 1, 0], 2)
    assert hysteresis(straight, 1) == pytest.approx(0, abs=1e-15)
    assert plateau(straight, 1) == (0, 0)
    waits = curve([1, 2, 1, 0], [1, 2, 2, 0], 2)
    assert plateau(waits, 1) == (0, 0.5)
    assert hysteresis(waits, 1) == pytest.approx(0.5)
    assert plateau(curve([1, 2, 3, 2, 0], [2, 2, 2, 1, 0], 3), 1) == (pytest.approx(2 / 3), 0)


def test_programme_with_an_end_per_unloading():
    """``unload_to`` may be one number or one per cycle; anything else is refused by name."""
    parameters = Parameters(cycles=3, loading=1, unloading=1, unload_to=(0.05, 0.02, 0.0))
    assert programme(parameters) == [0.1, 0.05, 0.1, 0.02, 0.1, 0.0]
    for wrong in ((0.01, 0.02), (0.01, 0.02, 0.2), -0.1, (0.0, 0.0, np.nan), ()):
        with pytest.raises(ValueError, match="unload_to"):
            programme(Parameters(cycles=3, unload_to=wrong))


@pytest.mark.slow
def test_other_settings_begin_anew(study):
    """A complete run costs nothing the second time; one with another number is computed again."""
    directory = study / "runs" / "again"
    mesh = dict(divisions=2, layers=1)
    parameters = Parameters(loading=1, unloading=1)
    for wanted in (parameters, parameters, Parameters(loading=1, unloading=2)):
        before = None if COMM.rank or not directory.exists() else directory.stat().st_ctime_ns
        compute(wanted, directory, **mesh)
        COMM.barrier()
        run = Run(directory)
        assert len(run.table["step"]) == wanted.loading + wanted.unloading
        assert run.parameters == wanted
        if COMM.rank == 0 and before and wanted == parameters:
            assert directory.stat().st_ctime_ns == before
        COMM.barrier()


@pytest.mark.skipif(not ALONE, reason="starts processes of its own")
@pytest.mark.slow
def test_killed_study_continues_to_the_same_bits(tmp_path):
    """Killed at any moment, twice, and started again, it ends with the numbers of one never killed."""
    launchers = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDI_", "MPIR_", "MPICH_")
    alone = {k: v for k, v in os.environ.items() if not k.startswith(launchers)}
    command = [sys.executable, "-m", "studies.punch", *COARSE, "--cases", "C", "--data-only"]

    def start(directory):
        return subprocess.Popen(
            [*command, "--output", directory], stderr=subprocess.PIPE, env=alone, cwd=ROOT
        )

    for step in (4, 17):
        process = start(tmp_path / "killed")
        run = tmp_path / "killed" / "runs" / "base" / "C"
        deadline = time.monotonic() + 100
        while not any(int(f.stem[-4:]) >= step for f in run.glob("checkpoint_*.npz")):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(1e-3)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        assert process.returncode == -signal.SIGKILL
        assert len(list((run / "steps").iterdir())) < 30
    for name in ("killed", "straight"):
        process = start(tmp_path / name)
        said = process.communicate(timeout=100)[1].decode()
        assert process.returncode == 0, said
    killed, straight = (tmp_path / n / "runs" / "base" / "C" for n in ("killed", "straight"))
    one, other = (rows(run / "history.csv") for run in (killed, straight))
    assert len(one) == len(other) == 30
    for a, b in zip(one, other):
        assert {**a, "seconds": None} == {**b, "seconds": None}
    for k in range(1, 31):
        fields = [np.load(run / "steps" / f"{k:04d}.npz") for run in (killed, straight)]
        for name in fields[0].files:
            assert np.array_equal(fields[0][name], fields[1][name]), (k, name)
