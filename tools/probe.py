# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What DOLFINx has this interpreter?  PYTHON tools/probe.py [PREFIX]    (for tools/setup)

Prints the interpreter and every module that must never be replaced, as a pip constraints file:

    # /usr/bin/python3
    numpy==1.24.2  # /usr/lib/python3/dist-packages/numpy/__init__.py

Exit code 1: no DOLFINx here, or the interpreter is the one of PREFIX (the environment that is
about to be made). Exit code 3: a DOLFINx that cannot be used; stderr says why.
"""

import importlib
import os
import sys
from importlib.metadata import PackageNotFoundError, version

MODULES = {  # module: distribution; the PyPI wheel wants dolfinx_solver to be imported first
    "dolfinx_solver": "dolfinx-solver-real",
    "dolfinx": "fenics-dolfinx",
    "basix": "fenics-basix",
    "ufl": "fenics-ufl",
    "ffcx": "fenics-ffcx",
    "petsc4py": "petsc4py",
    "mpi4py": "mpi4py",
    "numpy": "numpy",
    "scipy": "scipy",
}


def find():
    """The modules that can be imported, in order; None where a module is missing."""
    found = {}
    for name in MODULES:
        try:
            found[name] = importlib.import_module(name)
        except ModuleNotFoundError:
            found[name] = None
    return found


def refuse(reason):
    print(f"{sys.executable}: {reason}", file=sys.stderr)
    sys.exit(3)


def main():
    if len(sys.argv) > 1 and os.path.realpath(sys.argv[1]) == os.path.realpath(sys.prefix):
        sys.exit(1)
    try:
        found = find()
    except Exception as error:  # a broken installation fails in any way it likes
        refuse(f"its DOLFINx cannot be imported ({type(error).__name__}: {error})")
    if found["dolfinx"] is None:
        sys.exit(1)
    if found["petsc4py"] is None:
        refuse("its DOLFINx is built without PETSc (petsc4py); dolfinx_contact needs PETSc")
    release = found["dolfinx"].__version__
    if tuple(int(part) for part in release.split(".")[:2]) < (0, 5):
        refuse(f"its DOLFINx is {release}; dolfinx_contact needs 0.5 or newer")

    from petsc4py import PETSc

    if issubclass(PETSc.ScalarType, complex):
        refuse(
            "its PETSc works with complex numbers, and dolfinx_contact needs real ones;"
            " activate a DOLFINx built on a real-valued PETSc"
        )

    print("#", sys.executable)
    for name, module in found.items():
        if module is None:
            continue
        try:
            print(f"{MODULES[name]}=={version(MODULES[name])}  # {module.__file__}")
        except PackageNotFoundError:
            print(f"# {name} {getattr(module, '__version__', '')} {module.__file__}")


main()
