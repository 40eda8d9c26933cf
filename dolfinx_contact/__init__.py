# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Frictional contact of bodies with rigid or deformable surfaces, for FEniCSx, by the bi-potential method.

A name is imported where it is first used: those of arrays, such as ``solve_condensed``, ``Friction`` and what is in ``law`` and
``condensed``, need NumPy alone; those of bodies, such as ``ContactProblem``, need DOLFINx and PETSc.
"""

from ast import ImportFrom, parse
from hashlib import sha256
from importlib import import_module
from pathlib import Path

try:  # the wheel dolfinx-solver-real wants to be imported before DOLFINx, PETSc and MPI
    import dolfinx_solver  # noqa: F401
except ImportError:
    pass

try:
    from dolfinx_contact import _kernel
except ImportError as error:
    if error.name != __name__:  # it is there, and cannot be loaded
        raise
    raise ImportError(
        f"{__path__[0]} has no compiled kernel. If this is a clone of the source, Python has found it in the "
        "present directory, before an installed dolfinx_contact: start Python in another directory, or make the "
        "kernel here by 'make .venv/ready' and use .venv/bin/python."
    ) from error
_stubs = sha256(Path(__file__).with_name("_kernel.pyi").read_bytes()).hexdigest()
if getattr(_kernel, "stubs", str)() != _stubs:
    raise ImportError(
        f"the compiled kernel {_kernel.__file__} does not fit the Python files in {Path(__file__).parent}: compile it again, by "
        "'make .venv/ready' in a clone, by 'pip install .' in your own environment."
    )


# Name of each public object, and module that has it, as the stub beside this file says.
_MODULE_OF_NAME = {
    name.name: node.module
    for node in parse(Path(__file__).with_suffix(".pyi").read_text()).body
    if isinstance(node, ImportFrom)
    for name in node.names
}
_MODULE_NAMES = [name for name, home in _MODULE_OF_NAME.items() if home == __name__]  # of arrays
__all__ = [name for name in _MODULE_OF_NAME if name not in _MODULE_NAMES]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from importlib.metadata import version

        value = version(__name__)
    elif name in _MODULE_NAMES:
        value = import_module(f"{__name__}.{name}")
    elif name in _MODULE_OF_NAME:
        value = getattr(import_module(_MODULE_OF_NAME[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(
        {*_MODULE_OF_NAME, *(name for name in globals() if name.startswith("__")), "__version__"}
    )
