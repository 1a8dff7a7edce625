# Every target works on a fresh machine: scripts/fx finds FEniCSx or makes a place for it, once.
FX := scripts/fx
SCRIPTS := $(shell grep -ls __main__ scripts/*/*.py scripts/*/*/[a-z]*.py) scripts/examples/explore_forms.py scripts/gallery.py \
	scripts/golden.py scripts/pictures.py
NAMES := $(notdir $(basename $(SCRIPTS)))
# a test that hangs on some ranks is ended, and fails
MPI_TESTS = timeout --foreground $(LIMIT) $(FX) mpirun -n $(1) \
	python3 -m mpi4py -m pytest $(TESTS) $(SHORT) -m 'parallel and $(MARKS)' -q --color=no -p no:cacheprovider

.PHONY: help demo test test-rest test-all test-serial messages lint format docs release clean robustness tables figures $(NAMES)
.DEFAULT_GOAL := help

help:
	@echo "make demo     solve Example 7.2 into results/bar, with figures"
	@echo "make test     the core suite: the serial tests, then those of 2 and 3 ranks"
	@echo "make test-rest  the other short tests"
	@echo "make test-all  all of them, the slow ones too, and all combinations of parameters"
	@echo "make messages  renew the texts of messages in tests/snapshots"
	@echo "make golden   small problems of all kinds against stored numbers (ARGS=--renew stores them)"
	@echo "make lint     ruff and mypy"
	@echo "make format   let ruff format the sources"
	@echo "make tables figures  those of the thesis, and studies beside it, into results/"
	@echo "make NAME     run a script: $(sort $(NAMES))"
	@echo "make docs     the documentation, into build/docs (notebooks are executed)"
	@echo "make release  wheel and source distribution, built, installed and tried elsewhere"
	@echo "make clean    remove results and caches in this folder"
	@echo "FENICSX=wheels make test   the same in another place: wheels, sid (both dolfinx 0.11), debian"

demo:
	$(FX) python3 -m contact solve scripts/cases/bar.toml --out results/bar --plot

# A release has passed test-all. What is left out by --short: tests/conftest.py.
test test-rest: SHORT := --short
test: MARKS := core
test-rest: MARKS := not core and not release
test-all: MARKS := not release
# seconds
test test-rest: LIMIT := 1200
test-all: LIMIT := 7200
# Other files need not be imported.
test: TESTS = $(shell grep -rl --include='test_*.py' 'mark\.core' tests)
test-rest test-all: TESTS := tests
# The serial tests first: their workers compile most forms at the same time, for which ranks wait.
# One BLAS thread each: the workers and ranks fill the cores.
test test-rest test-all: export OMP_NUM_THREADS := 1
# Ranks that wait give way: there are fewer cores than ranks, or others use them too.
test test-rest test-all: export OMPI_MCA_mpi_yield_when_idle := 1
# Each of some fifty processes would compile the sources, and assertions, again.
test test-rest test-all test-serial: export PYTHONDONTWRITEBYTECODE :=
test test-rest test-all: SHELL := bash
test test-rest test-all:
	@set -o pipefail; status=0; last=$$(mktemp); trap 'rm -f $$last' EXIT; \
	echo "== serial"; $(FX) python3 -m pytest $(TESTS) $(SHORT) -m '$(MARKS)' -n auto --dist worksteal | tee $$last || status=1; \
	echo "== 2 ranks"; $(call MPI_TESTS,2) || status=1; \
	echo "== 3 ranks"; $(call MPI_TESTS,3) || status=1; \
	echo "== serial, as above"; tail -n 1 $$last; \
	exit $$status

test-serial: export OMP_NUM_THREADS := 1
test-serial:
	$(FX) python3 -m pytest tests -n auto --dist worksteal

messages:
	$(FX) python3 -m pytest tests -m wording --renew -n 0 -q

lint:
	scripts/ruff check .
	$(FX) env -u PYTHONPATH mypy

format:
	scripts/ruff format .

docs:
	$(FX) python3 docs/render.py
	$(FX) python3 -m sphinx -q -W --keep-going -b html docs build/docs
	@echo "build/docs/index.html"

release:
	$(FX) python3 -m pytest tests/scripts/test_release.py -m "release or not release" -q -o faulthandler_timeout=0

clean:
	rm -rf results build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

robustness:
	$(FX) python3 -m scripts.studies.robustness $(ARGS)

# A script that makes both is run once.
tables: setups hertz table_7_1 table_7_2 convergence_mechanics corner curved_foundations \
	pressure_on_axis nonlocal_friction tables_piezo tables_compliance stopping_8_3 limit_theorem refinement_8 \
	sensitivity agreement
figures: setups hertz figures_mechanics convergence_mechanics nonlocal_friction figures_piezo figures_compliance \
	limit_theorem

# a table, a figure, benchmarks, ...
$(NAMES):
	$(FX) python3 -m $(subst /,.,$(basename $(filter %/$@.py,$(SCRIPTS)))) $(ARGS)
