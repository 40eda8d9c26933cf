# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch as an animation of its stick and slip zones.  From the root of the clone:

python -m docs.moving_pictures  # results/study/cycle.gif, from a run of studies/punch
"""

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "results" / "study"


def cycle(case: str = "C", refine: int = 0) -> Path:
    """The second cycle in small increments, a frame each."""
    from studies.punch import Parameters, Punch, programme  # before DOLFINx, see its wheel

    # isort: split
    from matplotlib.animation import PillowWriter
    from matplotlib.figure import Figure

    from studies.punch.contact_map import LEGEND, draw_zones, gather

    parameters = Parameters(case=case, refine=refine, cycles=2, loading=12, unloading=24, tol=1e-8)
    punch, depths = Punch(parameters), programme(parameters)
    figure = Figure(figsize=(4.6, 5.0), dpi=100)
    figure.legend(**LEGEND | dict(loc="lower center", ncols=2, fontsize=9))
    axes = figure.add_axes((0.02, 0.13, 0.96, 0.8))
    writer, file = PillowWriter(fps=6), FOLDER / "cycle.gif"
    with writer.saving(figure, file, dpi=100):
        for number, depth in enumerate(depths):
            punch.press(depth)
            if number < len(depths) // 2:
                continue
            axes.clear()
            draw_zones(axes, gather(punch))
            figure.suptitle(f"case {case}, cycle 2: top {depth:.3f} mm down", fontsize=11)
            writer.grab_frame()
    return file


if __name__ == "__main__":
    print(cycle())
