# `make study` runs the main job and `make test` the tests; both build .venv from the hash-pinned lock first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STUDY ?= studies/kr270_milling.toml

.DEFAULT_GOAL := study
.PHONY: study test quick check fuzz docs figures benchmark lock clean

study: $(VENV)/.installed
	$(BIN)/edtk run $(STUDY)

# A file's tests run in one process, which share what they compute. Files run in their own order: by the
# number of their tests, the longest would come last and run alone. Compiled modules are kept for the
# processes that tests start, whatever the shell says. Each process computes in one thread: the matrices are
# small, and threads of several processes would wait for each other, spinning.
PYTEST := PYTHONDONTWRITEBYTECODE= OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed
	$(PYTEST)

# The first case of each test that takes less than an eighth of a second: the others are marked as slow, and
# what takes longer than a second all the same is listed at the end. Rooms
# where nearly every test fits a sheet or searches a plan are here with a few of their files.
QUICK := tests/criteria tests/design tests/fit tests/measure tests/robots tests/study tests/system \
	tests/report tests/verbs tests/commands \
	tests/calibration/test_told_part.py tests/calibration/test_template.py \
	tests/findings/test_known_part.py tests/findings/test_some_rows.py tests/findings/test_wording.py \
	tests/certificate/test_bounded_work.py tests/paper_figures/test_mean_distance.py \
	$(wildcard tests/test_*.py)

quick: $(VENV)/.installed
	$(PYTEST) -m "not slow and not zoo" --first-case --durations 5 --durations-min 1 $(QUICK)

docs: $(VENV)/.installed
	$(BIN)/sphinx-build -W -n -q -b html docs results/docs

check: $(VENV)/.installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Wrong inputs of all kinds, on all cores; findings are reproduced one by one with --case NUMBER.
fuzz: $(VENV)/.installed
	$(BIN)/python -m tests.fuzz --cases 100000 --record tests/fuzz/RECORD.md

figures: $(VENV)/.installed
	$(BIN)/python -m paper_figures

benchmark: $(VENV)/.installed
	$(BIN)/python studies/benchmarks/relax.py
	$(BIN)/python studies/benchmarks/plan.py
	$(BIN)/python studies/benchmarks/inference.py

$(VENV)/.installed: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(0 if (3, 11) <= v < (3, 14) else "edtk needs Python 3.11 to 3.13, this is %d.%d; try: make PYTHON=python3.12" % v)'
	$(PYTHON) -m venv --clear $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# Needs uv. Writes versions and hashes, and no address of any index.
lock:
	uv pip compile --universal --generate-hashes --no-emit-index-url --group dev --group docs pyproject.toml --output-file requirements.lock

clean:
	rm -rf $(VENV) results dist .pytest_cache .mypy_cache .ruff_cache
