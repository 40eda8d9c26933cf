# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""All tests run alike on one rank and on several (tools/mpitest): no rank is left waiting.

After each test the ranks meet. A rank that the others do not join within JOIN_SECONDS says so and
aborts the run; one that hangs alone is found in the same way by the others.
"""

import atexit
import os
import shutil
import sys
import tempfile
import time

import hypothesis
import pytest
from mpi4py import MPI

JOIN_SECONDS = float(os.environ.get("JOIN_SECONDS", 120))
comm = MPI.COMM_WORLD.Dup()  # never mistaken for a call of the tested code
failures = []  # what this rank would print at the end

# The same examples on every rank and in every run.
hypothesis.settings.register_profile("mpi", derandomize=True, deadline=None, database=None)
hypothesis.settings.load_profile("mpi")

if comm.size > 1:
    # pytest cleans up what it finds in its temporary directory, also what another rank needs there.
    temporary = tempfile.mkdtemp(prefix=f"pytest-rank{comm.rank}-")
    os.environ["PYTEST_DEBUG_TEMPROOT"] = temporary
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)


def meet(where):
    request = comm.Ibarrier()
    deadline = time.monotonic() + JOIN_SECONDS
    while not request.Test():
        if time.monotonic() > deadline:
            print(
                f"\nrank {comm.rank}: the other ranks did not come to the end of {where}"
                f" within {JOIN_SECONDS:g} s; aborting",
                *failures,
                sep="\n",
                file=sys.__stderr__,
                flush=True,
            )
            comm.Abort(1)
        time.sleep(1e-4)


def pytest_addoption(parser):
    parser.addoption(
        "--once",
        action="store_true",
        help="of each test function the first set of parameters alone",
    )
    parser.addoption("--rest", action="store_true", help="what --once leaves out")


@pytest.hookimpl(trylast=True)  # of those that -m and -k leave
def pytest_collection_modifyitems(config, items):
    once, rest = config.getoption("--once"), config.getoption("--rest")
    if not once and not rest:
        return
    first = {}
    for item in items:
        first.setdefault((item.path, getattr(item, "originalname", item.name)), item)
    firsts = set(first.values())
    config.hook.pytest_deselected(items=[item for item in items if (item in firsts) == rest])
    items[:] = [item for item in items if (item in firsts) != rest]


def pytest_sessionstart(session):
    expected = os.environ.get("EXPECTED_RANKS")
    if expected is not None and comm.size != int(expected):
        pytest.exit(f"asked for {expected} ranks, MPI has {comm.size}", returncode=1)


def pytest_report_header():
    return f"MPI: rank {comm.rank} of {comm.size}"


def pytest_runtest_logreport(report):
    if report.failed:
        failures.append(f"{report.nodeid} failed:\n{report.longreprtext}")


@pytest.hookimpl(trylast=True)
def pytest_runtest_logfinish(nodeid):
    if comm.size > 1:
        meet(nodeid)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure():
    if comm.size > 1:
        meet("the session")
