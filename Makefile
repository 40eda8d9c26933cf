# make punch    the paper's punch: the table, a picture and ParaView files in results/punch
# make study    six cycles of cases A, B, C: all figures on one page, results/study/study.html;
#               EXPLORE=1 also computes what the paper leaves open
# make test     a test of every feature: each Python test that is not marked slow with its first parameters, a few on
#               2 MPI ranks, too, and the kernel without Python
# make test-all everything, before a release: hours
# make stress   every solver on some 1,030 scenes, each answer judged from the mechanics in NumPy; resumable
# make docs     the site: tutorial, how-to, gallery, theory, reference; results/site/index.html
# make report   error against run time: every solver, and the peers beside it;
#               results/report/report.html, resumable; QUICK=1 in minutes, results/report-quick/report.html
# All set up .venv first (tools/setup), when something it was made from has changed.

.PHONY: punch study stress report docs test test-rest test-ranks \
	test-wheel test-wheel-ranks test-all format stubs clean

RANKS = -m "ranks and not slow" $(shell grep -l mark.ranks tests/*/test_*.py)
CORE = tests/surfaces/test_force.py tests/results/test_history.py tests/solvers/test_multigrid.py \
	tests/step/test_problem.py
made_from = tools/setup tools/probe.py pyproject.toml CMakeLists.txt dolfinx_contact/_kernel.pyi \
	$(wildcard cpp/src/*.cpp cpp/src/*/*.cpp cpp/src/*/*.h cpp/include/dolfinx_contact/*.h \
	cpp/include/dolfinx_contact/*/*.h)

punch: .venv/ready
	.venv/bin/python -m demos.demo_punch --output results/punch $(ARGS)

stress: .venv/ready
	.venv/bin/python -m benchmarks.stress --output results/stress $(ARGS)

report: .venv/ready
	PYTHONPATH=demos .venv/bin/python -m benchmarks.report --size $(if $(QUICK),quick,full) $(ARGS)

study: .venv/ready
	.venv/bin/python -m studies.punch --output results/study $(if $(EXPLORE),--explore) $(ARGS)

docs: .venv/ready
	tools/site .venv

test: .venv/ready
	tools/mpitest .venv 1 -m "not slow" --once $(ARGS)
	tools/mpitest .venv 2 -m "not slow" --once $(CORE) $(ARGS)
	tools/ctest example

# what .ci/run has beside it: the other parameters of these tests; those that are marked ranks on 2 ranks; the newest
# DOLFINx on PyPI, of which 2 ranks run the few of `make test`
test-rest: .venv/ready
	tools/mpitest .venv 1 -m "not slow" --rest

test-ranks: .venv/ready
	tools/mpitest .venv 2 $(filter-out $(CORE),$(RANKS)) --once

test-wheel: .venv-wheel/ready
	tools/mpitest .venv-wheel 1 -m "not slow" --once

test-wheel-ranks: .venv-wheel/ready
	tools/mpitest .venv-wheel 2 -m "not slow" --once $(CORE)

test-all:
	tools/test-all

format:
	tools/lint || tools/lint # the second time nothing is left to format

stubs: .venv/ready
	tools/stubs

.venv/ready: $(made_from)
	tools/setup .venv

.venv-wheel/ready: $(made_from)
	tools/setup .venv-wheel wheel

clean:
	rm -rf .venv .venv-wheel build results
