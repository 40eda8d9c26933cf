# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How the functions of the kernel treat NumPy arrays: any layout, no copies, the GIL released."""

import threading
import time
import tracemalloc

import numpy as np
import pytest
from mpi4py import MPI

from dolfinx_contact.law.bipotential import bipotential_gap
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.friction_cone import load_function, project_cone


@pytest.mark.parametrize("layout", ["C", "F", "strided", "reversed", "float32", "integers"])
def test_layouts(layout):
    """Any strides and any type that fits into float64 give the same as a plain array."""
    rng = np.random.default_rng(10)
    tau = np.round(8 * rng.normal(size=(70, 3)))
    expected = project_cone(tau.copy(), (0.3, 0.15))
    given = {
        "C": tau,
        "F": np.asfortranarray(tau),
        "strided": np.repeat(np.repeat(tau, 2, axis=0), 3, axis=1)[::2, ::3],
        "reversed": tau[::-1].copy()[::-1],
        "float32": tau.astype(np.float32),
        "integers": tau.astype(int),
    }[layout]
    assert np.array_equal(project_cone(given, (0.3, 0.15)), expected)


@pytest.mark.parametrize("order", ["C", "F", "every second"])
def test_no_copies(order):
    """float64 arrays of any strides are read in place: all that is allocated are the results."""
    n = 100_000
    every = 2 if order == "every second" else 1
    r, slip = (np.ones((every * n, k), order="F" if order == "F" else "C") for k in (3, 2))
    r, slip, gap, mu = r[::every], slip[::every], np.ones(every * n)[::every], (0.3, 0.15)
    for call, results in (
        (lambda: project_cone(r, mu), 3 * 8 + 1),
        (lambda: load_function(r, mu), 8),
        (lambda: Friction(mu).law(3).bipotential_gap(r, gap, slip), 8),
        # two numbers and some flags to tell what is outside of the cone
        (lambda: bipotential_gap(r, gap, slip, Friction(mu)), 5 * 8),
    ):
        tracemalloc.start()
        call()
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert 8 * n <= peak <= results * n + 50_000


@pytest.mark.skipif(MPI.COMM_WORLD.size > 1, reason="ranks that share cores leave threads no turn")
def test_other_threads_run():
    """While a thread is inside the kernel, another one executes Python."""
    tau = np.random.default_rng(1).normal(size=(1_000_000, 3))
    law, interval = Friction((0.3, 0.15)).law(3), {}

    def work():
        start = time.perf_counter()
        law.project(tau)
        interval["call"] = (start, time.perf_counter())

    seen = 0
    for _ in range(20):  # a busy machine may not give this thread a turn
        thread = threading.Thread(target=work)
        thread.start()
        ticks = []
        while thread.is_alive():
            ticks.append(time.perf_counter())
        start, end = interval["call"]
        # the outer tenths belong to calling and returning, with the GIL
        inner = [tick for tick in ticks if 0.1 < (tick - start) / (end - start) < 0.9]
        seen = max(seen, len(inner))
        if seen > 100:
            break
    assert seen > 100
