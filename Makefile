# make punch    the paper's punch: the table, a picture and ParaView files in results/punch
# make study    six cycles of cases A, B, C: all figures on one page, results/study/study.html;
#               EXPLORE=1 also computes what the paper leaves open
# make test     a test of every feature: the Python ones that are not marked slow, on 1 and 2 MPI ranks, and
#               the kernel without Python
# make test-all all tests: make test, the slow ones, 3 ranks, and the C++ ones
# make stress   every solver on some 840 scenes, each answer judged from the mechanics in NumPy; resumable
# make docs     the site: tutorial, how-to, gallery, theory, reference; results/site/index.html
# make report   error against run time: every solver, and the peers beside it;
#               docs/report.html, resumable; QUICK=1 in minutes, results/report-quick/report.html
# All set up .venv first (tools/setup), when something it was made from has changed.

.PHONY: punch study stress report docs test test-rest test-slow test-ranks test-all test-cpp test-python test-wheel \
	test-wheel-ranks format stubs clean

RANKS = 1 2 3
# tests of plain arrays, the same on every rank: they run on one alone
arrays = bipotential condensed_errors condensed_kernel condensed_newton condensed_rigid condensed_tied element_height \
	friction friction_cone judge return_map
# whole programs, whose parts have tests of their own, and what looks at sources: make test has them on one rank
programs = accuracy demos docs report stress structure study
# one test file or two of each feature that needs the mesh: make test has each of their tests once on 2 ranks
features = force friction_field held_by_contact history input_errors internal_variables mixed multigrid \
	nonlinear oblique_supports patch problem rewind shared_nodes surfaces
# of these a few, on several ranks of another DOLFINx: few, as meshes leave communicators behind
on_ranks = force history internal_variables multigrid nonlinear problem spence submeshes surfaces
no_arrays = $(arrays:%=--ignore=tests/test_%.py)
no_programs = $(programs:%=--ignore=tests/test_%.py)
features_alone = $(patsubst %,--ignore=%,$(filter-out $(features:%=tests/test_%.py),$(wildcard tests/test_*.py)))
made_from = tools/setup tools/probe.py pyproject.toml CMakeLists.txt \
	$(wildcard cpp/*.cpp cpp/*.h cpp/include/dolfinx_contact/*.h)

punch: .venv/ready
	.venv/bin/python -m demos.demo_punch --output results/punch $(ARGS)

stress: .venv/ready
	.venv/bin/python -m benchmarks.stress --output results/stress $(ARGS)

report: .venv/ready
	.venv/bin/python -m benchmarks.report --size $(if $(QUICK),quick,full) $(ARGS)

study: .venv/ready
	.venv/bin/python -m studies.punch --output results/study $(if $(EXPLORE),--explore) $(ARGS)

docs: .venv/ready
	tools/site .venv

test: .venv/ready
	tools/mpitest .venv 1 -m "not slow" $(ARGS)
	tools/mpitest .venv 2 -m "not slow" --once $(features_alone) $(ARGS)
	tools/ctest example

# what make test leaves out; it needs make test to come first
test-rest: test-cpp test-slow test-ranks

test-slow: .venv/ready
	tools/mpitest .venv 1 -m slow

test-ranks: .venv/ready
	tools/mpitest .venv 2 -m "not slow" $(features:%=tests/test_%.py)
	tools/mpitest .venv 2 -m "not slow" --once $(no_arrays) $(features:%=--ignore=tests/test_%.py)
	tools/mpitest .venv 2 -m slow --once
	tools/mpitest .venv 3 -m "not slow" --once $(no_arrays) $(no_programs)

test-all: test
	$(MAKE) test-rest

test-cpp: .venv/ready
	tools/ctest

test-python: .venv/ready
	for n in $(RANKS); do tools/mpitest .venv $$n $(ARGS) || exit 1; done

# those of the Python tests that touch DOLFINx, each once, on the newest one on PyPI; on 2 ranks a feature of each kind
test-wheel: .venv-wheel/ready
	tools/mpitest .venv-wheel 1 -m "not slow" --once $(no_arrays) $(ARGS)

test-wheel-ranks: .venv-wheel/ready
	tools/mpitest .venv-wheel 2 -m "not slow" $(on_ranks:%=tests/test_%.py) $(ARGS)

format: .venv/ready
	clang-format -i $$(git ls-files 'cpp/*.h' 'cpp/*.cpp')
	.venv/bin/ruff format .
	.venv/bin/ruff check --fix .

stubs: .venv/ready
	tools/stubs

.venv/ready: $(made_from)
	tools/setup .venv

.venv-wheel/ready: $(made_from)
	tools/setup .venv-wheel wheel

clean:
	rm -rf .venv .venv-wheel build results
