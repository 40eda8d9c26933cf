"""Orders and limits of sequences of measurements."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


def richardson(widths, values, orders=(0.3, 5.0)) -> tuple[float | None, float | None]:
    """Limit and order p of the last three values, ``value = limit + c width^p``, the widths in any ratios [L. F. Richardson 1911].

    Where they do not go one way, or no p within ``orders`` fits, there is no order and the finest is the limit.
    """
    if len(values) < 3:
        return (values[-1] if values else None), None
    (h1, h2, h3), (a, b, c) = widths[-3:], values[-3:]
    if not (b - a) * (c - b) > 0:
        return c, None

    def defect(p):
        return (b - a) / (c - b) - (h2**p - h1**p) / (h3**p - h2**p)

    if defect(orders[0]) * defect(orders[1]) > 0:
        return c, None
    order = float(brentq(defect, *orders))
    return c + (c - b) * h3**order / (h2**order - h3**order), order


def exponent(sizes, values) -> float:
    """p of ``value = c size^p``, by least squares of logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
