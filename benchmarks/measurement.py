# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Measurements of the report: each in a process of its own, kept on disk, and what they measure with."""

from __future__ import annotations

import functools
import hashlib
import importlib
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from datetime import datetime, timezone
from importlib.metadata import version
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from petsc4py import PETSc

import dolfinx_contact as dc
from dolfinx_contact.compat import version as dolfinx

ROOT = Path(__file__).resolve().parent.parent
OWN = [ROOT / name for name in ("dolfinx_contact", "benchmarks", "studies", "mechanics")]
LIMIT = 1800  # seconds of wall time after which a measurement counts as failed


@dataclass(frozen=True)
class Measurement:
    """A function ``module:name``, called with ``settings``, which JSON knows, in a fresh process."""

    name: str
    function: str
    settings: dict
    late: bool = False  # takes long: after all that does not

    def file(self, directory: Path) -> Path:
        return directory / f"{self.name.replace(' ', '_')}.json"


def stored(measurement: Measurement, directory: Path) -> dict | None:
    """The record that is on disk, if it was made with these settings and did not fail."""
    file = measurement.file(directory)
    record = json.loads(file.read_text()) if file.exists() else {}
    return record if "result" in record and record["settings"] == measurement.settings else None


def current(record: dict) -> bool:
    """Whether all that a record was made with, our modules and the compiled kernel, is still the same."""
    return all(digest(ROOT / file) == was for file, was in record["made_with"].items())


def compute(measurement: Measurement, directory: Path) -> dict:
    """Measure, and keep the record.

    A process that fails or is killed leaves a record with what it said under ``failed``; it is tried again
    in the next run.
    """
    settings, load, start = measurement.settings, [os.getloadavg()[0]], perf_counter()
    record = dict(settings=settings, commit=commit(), date=now(), load=load)
    with tempfile.NamedTemporaryFile("r") as answer:
        command = [sys.executable, "-m", "benchmarks.measurement", measurement.function]
        command += [json.dumps(settings), answer.name]
        try:
            done = run_alone(command, timeout=LIMIT)
            said = done.stderr[-600:] or f"exit status {done.returncode}"
        except subprocess.TimeoutExpired:
            said = f"stopped after {LIMIT} s"
        found = answer.read()
    record["seconds"] = perf_counter() - start
    load.append(os.getloadavg()[0])
    record |= json.loads(found) if found else dict(failed=said)
    file = measurement.file(directory)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(record, indent=1) + "\n")
    return record


def measure(function: str, settings: str, output: str) -> None:
    """What the process of a measurement does."""
    module, name = function.split(":")
    asked = getattr(importlib.import_module(module), name)
    before = made_with()  # a file may change while it is being measured
    result = asked(**json.loads(settings))
    Path(output).write_text(json.dumps(dict(result=result, made_with=made_with() | before)))


def made_with() -> dict[str, str]:
    """Digest of every file of this project, and of its compiled kernel, that this process has imported."""
    files = {Path(file) for m in list(sys.modules.values()) if (file := getattr(m, "__file__", None))}  # fmt: skip
    own = {f for f in files if any(d in f.parents for d in OWN) or f.name.startswith("_kernel")}
    own.discard(ROOT / "benchmarks" / "report" / "drawing.py")  # measures nothing
    return {os.path.relpath(file, ROOT): digest(file) for file in sorted(own)}


@functools.cache
def digest(file: Path) -> str:
    """Of the content down to ``evaluate``, below which a section only shows what was measured; of a file that is not
    there, of nothing."""
    content = file.read_bytes() if file.exists() else b""
    return hashlib.sha256(content.split(b"\ndef evaluate(")[0]).hexdigest()[:16]


def run_alone(command: list, cwd: Path = ROOT, **options) -> subprocess.CompletedProcess:
    """A process with one thread and nothing of an MPI launcher in its environment; what it says is text."""
    launchers = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDI_", "MPIR_", "MPICH_")
    env = {k: v for k, v in os.environ.items() if not k.startswith(launchers)}
    env |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    env["PYTHONPATH"] = os.pathsep.join([str(ROOT / "demos"), env.get("PYTHONPATH", "")])
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, **options)


# -- what a measurement ran on -----------------------------------------------------------------------


@functools.cache
def commit() -> str:
    """The last commit that changed the library, which is what is measured; a + marks changes beyond it."""
    asked = ["log", "-1", "--format=%h"], ["status", "--porcelain"]
    library = "--", "dolfinx_contact", "cpp"
    found, changed = (run_alone(["git", *what, *library]).stdout.strip() for what in asked)
    return found + "+" * bool(changed) or "unknown"


def now() -> str:
    return datetime.now(timezone.utc).strftime("%Y-%m-%d %H:%M UTC")


def machine() -> dict:
    """Processor, memory, compiler and versions."""
    processor = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())
    return dict(
        processor=processor[1] if processor else platform.processor(),
        cores=os.cpu_count(),
        memory_gb=round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9, 1),
        system=platform.platform(),
        compiler=run_alone([os.environ.get("CXX", "c++"), "--version"]).stdout.partition("\n")[0],
        python=platform.python_version(),
        numpy=np.__version__,
        dolfinx=dolfinx,
        petsc=".".join(map(str, PETSc.Sys.getVersion())),
        dolfinx_contact=version("dolfinx_contact"),
        commit=commit(),
    )


# -- what measurements measure with --------------------------------------------------------------------


SOLVERS = {
    "condensed Newton": dc.CondensedNewton,
    "fixed point, return": dc.FixedPoint,
    "fixed point, bipotential": functools.partial(dc.FixedPoint, map="bipotential"),
}


def mesh_of(size: str) -> dict:
    """What the mesh of the punch is made with: the coarsest of all for the tests."""
    return dict(divisions=2, layers=2) if size == "smallest" else {}


def timed(work, *arguments) -> tuple:
    """Processor seconds of a call, and what it returns."""
    start = process_time()
    found = work(*arguments)
    return process_time() - start, found


def peak_memory(anew: bool = False) -> int:
    """Bytes of resident memory at most, since the last call with ``anew``."""
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    status = Path("/proc/self/status").read_text()
    return 1024 * int(re.search(r"VmHWM:\s+(\d+)", status)[1])


EVENTS = dict(
    set_ups="PCSetUp", factorisations="MatLUFactorNum", back_solves="MatSolve", of_many_columns="MatMatSolve",
    preconditioner="PCApply", products="MatMult",
)  # fmt: skip


def counts() -> dict[str, int]:
    """How often PETSc did what in all stages, since its log was begun (``PETSc.Log.begin``)."""
    found = dict.fromkeys(EVENTS, 0)
    for stage in range(100):
        try:
            for name, event in EVENTS.items():
                found[name] += int(PETSc.Log.Event(event).getPerfInfo(stage)["count"])
        except PETSc.Error:  # there is no such stage
            break
    return found


def spread(values) -> dict:
    """Median, least and largest of repeated measurements, and how many there were."""
    least, median, largest = np.quantile(values, [0, 0.5, 1]).tolist()
    return dict(median=median, least=least, largest=largest, repetitions=len(values))


def ladder(first: int, last: int) -> list[float]:
    """Tolerances 10^-first ... 10^-last."""
    return [float(f"1e-{k}") for k in range(first, last + 1)]


if __name__ == "__main__":
    measure(*sys.argv[1:])
