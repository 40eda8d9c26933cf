# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The piles of ``rigid_family.py``: the time to a solution beside that of Siconos's methods, each from zero.

    python -m benchmarks.peers.siconos_piles FILE [--smallest 150] [--largest 620]

A peer's method is stopped after `PATIENCE` times ours.  Both are judged alike, from ``W``, ``q`` and the reactions alone:
``|r - proj(r - k (w_n + mu |w_t|, w_t))| / |r|`` of all contacts, ``k`` one over the mean normal compliance.
"""

import argparse
import json
import warnings
from collections import Counter
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter

import numpy as np
import siconos.numerics as sn

import dolfinx_contact as dc
from benchmarks.measurement import commit, now
from benchmarks.rigid_family import scenes

TOL, PATIENCE, SECONDS = 1e-8, 2.0, 120.0
METHODS = dict(NSGS=10**7, NSN_AC=1000, ADMM=10**6)  # iterations, more than the time is enough for


def error(W, q, mu, r) -> float:
    w = (W @ r.ravel()).reshape(r.shape) + q
    slip = np.linalg.norm(w[:, :2], axis=1)
    x = r - np.column_stack((w[:, :2], w[:, 2] + mu * slip)) / W.diagonal()[2::3].mean()
    t, n = np.linalg.norm(x[:, :2], axis=1), x[:, 2]
    on_cone = np.maximum((n + mu * t) / (1 + mu**2), 0)
    inside = t <= mu * n
    proj = np.column_stack((x[:, :2] * (mu * on_cone / np.maximum(t, 1e-300))[:, None], on_cone))
    proj[inside] = x[inside]
    return float(np.linalg.norm(r - proj) / np.linalg.norm(r))


def siconos(pipe, method, iterations, scene) -> None:
    n = len(scene.q)
    order = np.arange(3 * n).reshape(n, 3)[:, [2, 0, 1]].ravel()  # normal components first
    W = scene.W.tocsc()[order][:, order]
    warnings.simplefilter("ignore")  # of integers that are converted
    problem = sn.FrictionContactProblem(
        3, n, W, scene.q.ravel()[order].copy(), np.full(n, scene.mu)
    )
    options = sn.SolverOptions(getattr(sn, f"SICONOS_FRICTION_3D_{method}"))
    options.dparam[sn.SICONOS_DPARAM_TOL] = TOL
    options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = iterations
    reaction, start = np.zeros(3 * n), perf_counter()
    sn.fc3d_driver(problem, reaction, np.zeros(3 * n), options)
    seconds, back = perf_counter() - start, np.empty(3 * n)
    back[order] = reaction
    pipe.send((seconds, error(scene.W, scene.q, scene.mu, back.reshape(n, 3))))


def theirs(method, iterations, scene, limit) -> tuple[float, float] | None:
    """Seconds and error, or None where they took longer than `limit` or gave up."""
    context = get_context("fork")  # imports are made
    ours, end = context.Pipe()
    process = context.Process(target=siconos, args=(end, method, iterations, scene))
    process.start()
    end.close()
    try:
        return ours.recv() if ours.poll(limit + 1.0) else None
    except EOFError:
        return None
    finally:
        process.kill()
        process.join()


def main(file: Path, smallest: int, largest: int) -> None:
    warnings.simplefilter("ignore", dc.RoundingWarning)
    rows, outcomes = [], Counter()
    for scene in scenes(largest):
        if len(scene.q) < smallest:
            continue
        start = perf_counter()
        try:
            found = dc.solve_condensed(scene.W, scene.q, dc.Friction(scene.mu), max_seconds=SECONDS)
        except dc.CondensedNotConverged as failure:
            found = failure.best
        row = dict(kind=scene.kind, contacts=len(scene.q), seed=scene.seed, mu=scene.mu, branch=found.branch,
                   seconds=perf_counter() - start, error=error(scene.W, scene.q, scene.mu, found.reaction))  # fmt: skip
        limit = PATIENCE * row["seconds"]
        for method, iterations in METHODS.items():
            answer = theirs(method, iterations, scene, limit)
            if answer is not None and answer[0] <= limit:
                row[method] = answer
        good = [row[method][0] for method in METHODS if method in row and row[method][1] < 10 * TOL]
        row["ratio"] = min(good, default=limit) / row["seconds"]
        row["solved"] = bool(good)
        outcomes["ours sooner or theirs not solved" if not good or row["ratio"] >= 1 else "theirs sooner"] += 1  # fmt: skip
        rows.append(row)
        print({key: f"{value:.2g}" if isinstance(value, float) else value for key, value in row.items()}, flush=True)  # fmt: skip
    file.write_text(json.dumps(dict(commit=commit(), date=now(), rows=rows), indent=1) + "\n")
    print(dict(outcomes))


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("--smallest", type=int, default=150)
    parser.add_argument("--largest", type=int, default=620)
    main(**vars(parser.parse_args()))
