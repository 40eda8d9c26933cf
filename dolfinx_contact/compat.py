# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Compatibility layer for all supported DOLFINx releases, which ``docs/index.md`` lists.

It provides the names of the current DOLFINx release.  Only this file depends on the installed
release. Package, demos and tests import from here all functions that differ between releases.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterable
from inspect import signature
from types import SimpleNamespace
from typing import Any

import dolfinx
import dolfinx.fem.petsc
import dolfinx.mesh
import numpy as np
import ufl
from dolfinx import fem, graph, la
from dolfinx.mesh import create_interval, create_mesh
from mpi4py import MPI
from petsc4py import PETSc

from dolfinx_contact.support.collective import raised_together

if np.issubdtype(PETSc.ScalarType, np.complexfloating):
    raise ImportError(
        "dolfinx_contact needs a real-valued PETSc: this one computes with complex numbers "
        f"({PETSc.ScalarType.__name__}), and contact inequalities have no meaning there. Install or "
        "activate the real build (Debian: python3-dolfinx-real, conda: petsc=*=real*, "
        "PyPI: dolfinx-solver-real)."
    )

version: str = dolfinx.__version__

_INSERT_ADD = (la.InsertMode if hasattr(la, "InsertMode") else la.ScatterMode).add


def functionspace(mesh: Any, element: Any) -> fem.FunctionSpace:
    """Return a function space, ``fem.functionspace`` of DOLFINx >= 0.7.

    Args:
        mesh: The mesh.
        element: ``(family, degree)`` or ``(family, degree, shape)``.
    """
    if hasattr(fem, "functionspace"):
        return fem.functionspace(mesh, element)
    family, degree, *shape = element
    if not shape or shape[0] == ():
        return fem.FunctionSpace(mesh, (family, degree))
    if len(shape[0]) == 2:
        return fem.TensorFunctionSpace(mesh, (family, degree), shape=shape[0])
    return fem.VectorFunctionSpace(mesh, (family, degree), dim=shape[0][0])


def mixed_functionspace(mesh: Any, elements: Any) -> fem.FunctionSpace:
    """Return a mixed function space, ``basix.ufl.mixed_element`` in DOLFINx >= 0.7.

    Args:
        mesh: The mesh.
        elements: One element for each sub-space, as for ``functionspace``.
    """
    parts = [functionspace(mesh, element).ufl_element() for element in elements]
    if hasattr(ufl, "MixedElement"):  # legacy UFL elements
        return fem.FunctionSpace(mesh, ufl.MixedElement(*parts))
    import basix.ufl

    return fem.functionspace(mesh, basix.ufl.mixed_element(parts))


def interpolation_points(V: fem.FunctionSpace) -> np.ndarray:
    """Return the interpolation points of the element of ``V``.

    They are a method before DOLFINx 0.10, a property since.
    """
    points = V.element.interpolation_points
    return points() if callable(points) else points


def model_to_mesh(model: Any, comm: Any, rank: int, gdim: int | None = None) -> Any:
    """Return a gmsh model as an object with ``mesh``, ``cell_tags`` and ``facet_tags``.

    The result is as in DOLFINx >= 0.10.

    Args:
        model: The gmsh model.
        comm: MPI communicator.
        rank: Rank that holds the model.
        gdim: Geometric dimension of the mesh; None is the dimension of the model.  (DOLFINx itself
            uses three by default.)

    Raises:
        ValueError: on all ranks, if the model is empty, as after ``gmsh.open`` of a missing file,
            or has no physical group of cells.
    """
    with raised_together(comm):
        dim = model.getDimension() if comm.rank == rank else gdim
        if comm.rank == rank and dim < 1:
            raise ValueError(
                "the gmsh model is empty: gmsh.open does not say that its file is missing; or make bodies, and occ.synchronize()."
            )
        if comm.rank == rank and not model.getPhysicalGroups(dim):
            raise ValueError(
                f"the gmsh model has no physical group of dimension {dim}, its cells: model.addPhysicalGroup({dim}, bodies)."
            )
    if gdim is None:
        gdim = comm.bcast(dim, root=rank)
    try:
        from dolfinx.io import gmsh
    except ImportError:
        from dolfinx.io import gmshio as gmsh
    found = gmsh.model_to_mesh(model, comm, rank, gdim=gdim)
    if hasattr(found, "facet_tags"):
        return found
    return SimpleNamespace(mesh=found[0], cell_tags=found[1], facet_tags=found[2])


def second_order(domain: Any) -> Any:
    """Return a copy of a mesh with second-order geometry, whose nodes may be moved.  Collective."""
    gdim, cell = domain.geometry.dim, domain.topology.cell_name()
    V = functionspace(domain, ("Lagrange", 2, (gdim,)))
    count, index_map = domain.topology.index_map(domain.topology.dim).size_local, V.dofmap.index_map
    cells = index_map.local_to_global(cell_nodes(V)[:count].ravel().astype(np.int32))
    cells = cells.reshape(count, -1).astype(np.int64)
    x = V.tabulate_dof_coordinates()[: index_map.size_local, :gdim].copy()
    if hasattr(ufl, "VectorElement"):  # legacy UFL elements
        element = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 2))
    else:
        import basix.ufl

        element = basix.ufl.element("Lagrange", cell, 2, shape=(gdim,))
    given = {"x": x, "domain" if "domain" in signature(create_mesh).parameters else "e": element}
    return create_mesh(domain.comm, cells, **given)


def refined(domain: Any, cells: np.ndarray) -> Any:
    """Return a refined mesh of simplices.  Collective.

    Args:
        domain: The mesh.
        cells: Cells to refine, local indices of owned cells.  Further cells are divided as needed
            for a conforming mesh.
    """
    tdim = domain.topology.dim
    domain.topology.create_entities(1)
    domain.topology.create_connectivity(tdim, 1)
    edges = domain.topology.connectivity(tdim, 1).array.reshape(-1, 6 if tdim == 3 else 3)
    found = dolfinx.mesh.refine(domain, np.unique(edges[cells]).astype(np.int32))
    return (
        found[0] if isinstance(found, tuple) else found
    )  # a tuple with parent cells and facets since 0.9


def partitioner(ranks: Callable[[int, int], Any], nodes_per_cell: int) -> Any:
    """Return a ``partitioner`` for mesh generators such as ``create_box``.

    Args:
        ranks: Function of the number of cells on this rank and the number of ranks; it returns the
            destination rank of each of these cells.
        nodes_per_cell: Number of nodes of a cell.
    """

    def partition(comm: MPI.Comm, size: int, *cells: Any):
        # an adjacency list before 0.10 (0.5 gives a ghost mode after it), a list of flat arrays
        # since
        cells = next(c for c in reversed(cells) if isinstance(c, list) or hasattr(c, "num_nodes"))
        count = cells[0].size // nodes_per_cell if isinstance(cells, list) else cells.num_nodes
        destinations = np.asarray(ranks(count, size), dtype=np.int32)
        if not hasattr(graph, "adjacencylist"):
            return dolfinx.cpp.graph.AdjacencyList_int32(destinations)
        return _cpp(graph.adjacencylist(destinations))

    return partition


def _cpp(wrapped: Any) -> Any:
    """Return the C++ object behind a Python object, which some releases wrap."""
    return getattr(wrapped, "_cpp_object", wrapped)


def is_function_space(V: object) -> bool:
    return isinstance(V, fem.FunctionSpace if hasattr(fem, "FunctionSpace") else ())


def lagrange_degree(V: fem.FunctionSpace) -> int | None:
    """Return the degree of a continuous Lagrange space; None for any other element."""
    element = V.ufl_element()
    if callable(getattr(element, "family", None)):  # legacy UFL elements, DOLFINx < 0.7
        return element.degree() if element.family() in ("Lagrange", "Q") else None
    continuous = not getattr(element, "discontinuous", True)
    return element.degree if element.family_name == "P" and continuous else None


def value_size(V: fem.FunctionSpace) -> int:
    """Return the number of components of a function of the space."""
    element = V.ufl_element()
    if hasattr(element, "value_size"):  # legacy UFL elements
        return element.value_size()
    return int(np.prod(element.reference_value_shape, dtype=int))


def is_part(V: fem.FunctionSpace) -> bool:
    """Return whether a space is a sub-space, ``W.sub(i)``."""
    return len(_cpp(V).component()) > 0


def is_within(part: fem.FunctionSpace, V: fem.FunctionSpace) -> bool:
    """Return whether a space is equal to ``V`` or a sub-space of it."""
    return _cpp(V).contains(_cpp(part))


def cell_nodes(V: fem.FunctionSpace):
    """Return local node indices of each cell, ``shape=(cells, nodes)``.

    DOLFINx stores them in an adjacency list before 0.8.
    """
    nodes = V.dofmap.list
    if hasattr(nodes, "array"):
        nodes = nodes.array.reshape(nodes.num_nodes, V.dofmap.dof_layout.num_dofs)
    return nodes


def cell_dofs(V: fem.FunctionSpace):
    """Return local degrees of freedom of each cell, blocks unrolled, ``shape=(cells, dofs)``."""
    bs = V.dofmap.index_map_bs
    cells = cell_nodes(V)
    return (bs * cells[:, :, None] + np.arange(bs)).reshape(len(cells), bs * cells.shape[1])


def read_cells(mesh: dolfinx.mesh.Mesh):
    """Return the original index of each cell in the input of the mesh.

    The result is empty if DOLFINx does not provide it, as for submeshes.
    """
    try:
        return mesh.topology.original_cell_index
    except RuntimeError:  # for submeshes since 0.10
        return []


def cell_points(mesh: dolfinx.mesh.Mesh):
    """Return the geometry nodes of each cell, ``shape=(cells, points)``.

    DOLFINx stores one array for each cell type since 0.8.
    """
    points = getattr(mesh.geometry, "dofmaps", None)
    points = (
        mesh.geometry.dofmap if points is None else points(0) if callable(points) else points[0]
    )
    if hasattr(points, "array"):  # an adjacency list before 0.8
        points = points.array.reshape(-1, points.array.size // max(points.num_nodes, 1) or 1)
    return points


def bc_dofs(bc: Any, size: int):
    """Return the degrees of freedom that a boundary condition fixes, local, unrolled.

    Args:
        bc: The boundary condition.
        size: Number of owned degrees of freedom; only owned ones are returned.
    """
    dofs = np.asarray(_cpp(bc).dof_indices()[0])
    return dofs[dofs < size]


def bc_constants(bcs: Iterable[Any]) -> list:
    """Return the values of boundary conditions that are ``Constant`` objects, not Functions."""
    return [bc.g for bc in bcs if hasattr(bc.g, "value") and not hasattr(bc.g, "x")]


def set_bc_values(array: np.ndarray, bcs: Iterable[Any]) -> None:
    """Write boundary values into a local array, ghosts included.

    The method is ``bc.set`` in DOLFINx >= 0.9.
    """
    for bc in bcs:
        if hasattr(bc, "set"):
            bc.set(array)
        else:
            fem.set_bc(array, [bc])


def compiled(
    form: Any,
    form_compiler_options: dict | None = None,
    jit_options: dict | None = None,
    entity_maps: Any = None,
) -> Any:
    """Return a compiled form, see ``fem.form``.

    Since DOLFINx 0.9, its Functions may be defined on several meshes.

    Args:
        form: UFL form.
        form_compiler_options: Options of FFCx; ``form_compiler_params`` before 0.6.
        jit_options: Options for compiling the generated code; ``jit_params`` before 0.6.
        entity_maps: Relation between meshes as in ``fem.form``: a dictionary of arrays by mesh
            before 0.10, a list of ``EntityMap`` since.

    Raises:
        ValueError: ``entity_maps`` are given, but DOLFINx is older than 0.9.
    """
    known = signature(fem.form).parameters
    now = "options" if "jit_options" in known else "params"
    # Copies, since 0.5 modifies the dictionaries, even its own defaults.
    options = {
        f"form_compiler_{now}": dict(form_compiler_options or {}),
        f"jit_{now}": dict(jit_options or {}),
    }
    if entity_maps is None:
        return fem.form(form, **options)
    if "entity_maps" not in known:
        raise ValueError(
            f"entity_maps need DOLFINx 0.9 or newer, this is {version}: here all Functions in F live on the mesh of u."
        )
    return fem.form(form, **options, entity_maps=entity_maps)


def assemble_into(x: Any, form: Any) -> None:
    """Assemble a linear form into a distributed vector, ghost entries added to their owners."""
    x.array[:] = 0.0
    fem.assemble_vector(x.array, form)
    add_to_owners(x)


def add_to_owners(x: Any) -> None:
    """Add the ghost entries of a distributed vector to the entries of their owners."""
    x.scatter_reverse(_INSERT_ADD)


def petsc_vec(u: fem.Function) -> PETSc.Vec:
    """Return the PETSc vector of a Function.

    It is ``u.x.petsc_vec`` in DOLFINx >= 0.9, ``u.vector`` before.
    """
    return u.x.petsc_vec if hasattr(u.x, "petsc_vec") else u.vector


def tagged(tags: Any, mesh: Any) -> bool:
    """Return whether ``MeshTags`` belong to a mesh.

    They refer to the mesh before DOLFINx 0.7, to its topology since.
    """
    tags = _cpp(tags)
    topology = tags.topology if hasattr(tags, "topology") else tags.mesh.topology
    return topology is _cpp(mesh).topology


def same_mesh(V: fem.FunctionSpace, W: fem.FunctionSpace) -> bool:
    """Return whether two function spaces are on the same mesh."""
    return _cpp(V.mesh).topology is _cpp(W.mesh).topology


def is_condition(bc: object) -> bool:
    """Return whether an object is a boundary condition returned by ``dirichletbc``."""
    return hasattr(_cpp(bc), "dof_indices")


def condition_lives_on(bc: Any, V: fem.FunctionSpace) -> bool:
    """Return whether a boundary condition is on ``V`` or a sub-space of it."""
    return is_within(bc.function_space, V)


def free_garbage(comm: MPI.Comm) -> None:
    """Free PETSc objects that Python's garbage collector has released.  Collective.

    Since 3.18, PETSc keeps such objects, since it can free parallel objects only on all ranks at
    once.
    """
    if hasattr(PETSc, "garbage_cleanup"):
        PETSc.garbage_cleanup(comm)


def may_free_alone(comm: MPI.Comm) -> bool:
    """Return whether PETSc objects may be freed here: one rank, and PETSc not finalised."""
    return not PETSc.Sys.isFinalized() and comm.size == 1


def option_was_read(name: str) -> bool:
    """Return whether PETSc has read an option of its database; True if it cannot be determined.

    petsc4py has no function for this, so PETSc's library is called directly.
    """
    try:
        used = ctypes.CDLL(PETSc.__file__).PetscOptionsUsed
    except (OSError, AttributeError, TypeError):
        return True
    used.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.POINTER(ctypes.c_int)]
    found = ctypes.c_int(0)
    return used(None, name.encode(), ctypes.byref(found)) != 0 or bool(found.value & 1)


def intervals(n: int) -> Any:
    """Return a mesh of ``n`` equal intervals on [0, 1], on this rank alone."""
    return create_interval(MPI.COMM_SELF, n, [0.0, 1.0])


def cell_values(expression: fem.Expression, mesh: Any, cells: np.ndarray) -> np.ndarray:
    """Return the values of an ``Expression`` with one point, one row for each cell."""
    if "mesh" in signature(expression.eval).parameters:
        return expression.eval(mesh, cells).reshape(cells.size, -1)
    return expression.eval(cells).reshape(cells.size, -1)
