# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A progress bar with the remaining time, shown on a terminal if tqdm is installed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(rank: int, total: float, start: float = 0.0) -> Iterator[Callable[[float], None]]:
    """Context manager that yields a function to show the progress of a load history.

    Args:
        rank: Rank of this process; only rank 0 shows the bar.
        total: Load parameter at the end.
        start: Load parameter at the beginning.
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
