# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A progress bar with the time left, on a terminal and if tqdm is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(rank: int, total: float, start: float = 0.0) -> Iterator[Callable[[float], None]]:
    """Context of a function that shows how far a load history is on its way from ``start`` to ``total``.

    Args:
        rank: Of this process; rank 0 shows.
        total: Where it ends.
        start: Where it begins.
    """
    bar = None
    if rank == 0 and sys.stderr.isatty():
        try:
            from tqdm import tqdm

            bar = tqdm(total=max(total - start, 0.0))
        except ImportError:
            pass

    def show(now: float) -> None:
        if bar is not None:
            bar.update(now - start - bar.n)

    try:
        yield show
    finally:
        if bar is not None:
            bar.close()
