# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How the package is built: floors of imports, length of its text, what a plain load step walks through.

``python -m benchmarks.house`` prints it all.  A change of module is a call of a function of another module of the package
than the call before.
"""

import ast
import io
import sys
import tokenize
from functools import cache
from pathlib import Path

import dolfinx_contact as dc
from mechanics.scenes import block

PACKAGE = Path(dc.__file__).parent
FILES = {".".join(f.relative_to(PACKAGE).with_suffix("").parts): f for f in PACKAGE.rglob("*.py")}
MODULES = {str(file): name for name, file in FILES.items()}
BLANK = {tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}  # a string after it is a docstring


@cache
def floor(name: str) -> int:
    """Modules of the package in the longest chain of imports at the top that ends with this one."""
    tree = ast.parse(FILES[name].read_text())
    imports = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    names = {f"{i.module}.{part}" for i in imports for part in ("", *(a.name for a in i.names))}
    found = {name.partition(".")[2].rstrip(".") for name in names} & set(FILES)
    return 1 + max(map(floor, found), default=0)


def code_lines(text: str) -> int:
    """Lines without comments and docstrings."""
    lines, last = set(), tokenize.NEWLINE
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.COMMENT, tokenize.NL, tokenize.ENDMARKER):
            continue
        if token.type not in BLANK and not (token.type == tokenize.STRING and last in BLANK):
            lines |= set(range(token.start[0], token.end[0] + 1))
        last = token.type
    return len(lines)


def calls_of_a_step(solver) -> list[str]:
    """Modules whose functions the second step of a cube on one plane calls, one after another."""
    scene, calls = block(cells=(4, 4, 4), mu=0.3, p=None, tol=1e-8, solver=solver), []
    scene.move_top(0.001, 0.0005, -0.005)
    scene.problem.solve()
    scene.move_top(0.002, 0.001, -0.01)

    def note(frame, event, _):
        if event == "call" and frame.f_code.co_filename in MODULES:
            calls.append(MODULES[frame.f_code.co_filename])

    sys.setprofile(note)
    scene.problem.solve()
    sys.setprofile(None)
    return calls


if __name__ == "__main__":
    texts = [file.read_text() for file in FILES.values()]
    lines = [line for text in texts for line in text.splitlines()]
    print(
        f"{len(FILES)} modules, {max(map(floor, FILES))} floors, {sum(map(code_lines, texts))} lines of code"
    )
    print(f"{sum(len(line) > 100 for line in lines)} lines above 100 characters, {sum('fmt: skip' in line for line in lines)} fmt: skip")  # fmt: skip
    for solver in (dc.CondensedNewton(), dc.FixedPoint(), dc.SparseNewton()):
        calls = calls_of_a_step(solver)
        changes = sum(a != b for a, b in zip(calls, calls[1:]))
        print(
            f"{type(solver).__name__}: {len(calls)} calls, {len(set(calls))} modules, {changes} changes of module"
        )
