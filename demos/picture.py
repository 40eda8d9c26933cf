"""A picture at the end of a demo: shown in a notebook, written to a file by a script."""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path

from mpi4py import MPI


def picture(draw, *data) -> None:
    """Call ``draw(figure, *data)`` where somebody wants to see it.

    In a notebook the figure is shown. A script writes it to the file that is its only argument, on rank
    0; without one nothing is drawn, and matplotlib is not needed.
    """
    inside = "ipykernel" in sys.modules
    if MPI.COMM_WORLD.rank != 0 or not inside and len(sys.argv) < 2:
        return
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.5), layout="constrained")
    draw(figure, *data)
    file = BytesIO() if inside else Path(sys.argv[1])
    figure.savefig(file, dpi=110)
    if inside:
        from IPython.display import Image, display

        display(Image(file.getvalue()))
