# Everything sets itself up in .venv; nothing outside this folder is touched, except that `make test` asks
# scripts/debian-packages for programs it drives (it prints what it installs, and why).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
LOOSE := $(addprefix --disable-error-code ,misc no-untyped-call import-untyped import-not-found)
ROS2 := $(VENV)/ros2-jazzy.stamp $(VENV)/ros2-kilted.stamp
PIP := $(BIN)/python -m pip --disable-pip-version-check -q

# where it is set, as in many containers, each of the hundreds of programs that tests start compiles all its modules
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo caches test test-python test-all check bench docs wheel clean
.DEFAULT_GOAL := demo

demo: $(VENV)/volery.stamp ## parcels across a city, two allocations side by side, a report
	$(BIN)/volery demo

caches: $(VENV)/ros1.stamp # what each of the many processes would compile else: physics, and assertions of tests
	@$(BIN)/python -W ignore scripts/compile_numerics.py
	@$(BIN)/pytest --collect-only -qq >/dev/null

BY_FILE := --dist loadfile --no-loadscope-reorder --durations=5

test: $(VENV)/test.stamp caches ## all tests, against real sockets, clients and a browser
	@status=0; \
	$(BIN)/pytest -n auto $(BY_FILE) -m "not integration and not optional and not long" || status=1; \
	echo "real ROS, of whose time most is waiting, beside the other integration tests; its result comes last"; \
	$(BIN)/pytest --durations=5 -m "not long" tests/integration/transports >$(VENV)/transports.log 2>&1 & transports=$$!; \
	$(BIN)/pytest -n auto $(BY_FILE) -m "integration and not long" tests/integration \
		--ignore tests/integration/transports || status=1; \
	wait $$transports || status=1; \
	cat $(VENV)/transports.log; \
	exit $$status

test-python: ## traces, embedded ROS and C++ on another version of Python: make test-python PYTHON=python3.13
	@$(MAKE) --no-print-directory PYTHON=python3 $(VENV)/volery.stamp
	@scripts/test-python $(VENV) $(PYTHON)

test-all: test ## the same, features that are off by default, and what is rare or computes for minutes
	$(BIN)/pytest -n auto $(BY_FILE) -m "long or optional"

CHECKS := check-style check-types check-types-of-scripts check-layers check-words check-pages

check: $(CHECKS) ## style, types, layers, circles, words, and whether generated pages are up to date

.PHONY: $(CHECKS)
$(CHECKS): $(VENV)/dev.stamp

check-style:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

check-types:
	$(BIN)/mypy

check-types-of-scripts: # with a cache of its own: other options make mypy check everything anew
	$(BIN)/mypy --cache-dir .mypy_cache/scripts $(LOOSE) bench/*.py scripts/*.py

check-layers:
	PYTHONPATH=src $(BIN)/lint-imports

check-words:
	$(BIN)/python scripts/check_sources.py

check-pages:
	$(BIN)/python scripts/generate_docs.py --check

bench: $(VENV)/bench.stamp ## every figure that the README and the docs claim
	@set -e; for script in bench/*.py; do echo "== $$script"; $(BIN)/python $$script; done

docs: $(VENV)/docs.stamp ## regenerate the generated pages, build the site into site/
	$(BIN)/python scripts/generate_docs.py
	$(BIN)/mkdocs build --strict --quiet
	@echo "docs: site/index.html"

wheel: $(VENV)/volery.stamp ## a wheel with the machine code of this architecture, in dist/
	VOLERY_COMPILE=1 $(PIP) wheel --no-deps -w dist .

clean: ## remove what was built, not what was recorded
	rm -rf $(VENV) build dist site .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

$(BIN)/python:
	@$(PYTHON) -m venv $(VENV) 2>/dev/null || { scripts/debian-packages python3-venv && $(PYTHON) -m venv $(VENV); }
	@$(PIP) install -U 'pip>=25.1'

$(VENV)/volery.stamp: pyproject.toml | $(BIN)/python
	@echo "setting up $(VENV): volery and what it needs"
	@$(PIP) install -e '.[all]'
	@touch $@

$(VENV)/dev.stamp: $(VENV)/volery.stamp
	@echo "setting up $(VENV): tests and checks"
	@$(PIP) install --group dev
	@touch $@

$(VENV)/test.stamp: $(VENV)/ros1.stamp scripts/debian-packages $(ROS2)
	@echo "setting up $(VENV): independent MAVLink clients"
	@$(PIP) install --group clients
	@scripts/debian-packages chromium native libeigen3-dev
	@touch $@

# after dev.stamp: with `make -j`, one installs into $(VENV) at a time, beside those that make ROS 2
$(VENV)/ros1.stamp: $(VENV)/dev.stamp scripts/debian-packages scripts/ros1-modules
	@echo "setting up $(VENV): ROS 1"
	@scripts/debian-packages ros1 roscpp
	@$(PIP) install --group ros1
	@scripts/ros1-modules $(VENV)
	@touch $@

$(VENV)/ros2-%.stamp: $(VENV)/volery.stamp scripts/ros2-venv
	@echo "setting up $(VENV)/ros2-$*: ROS 2"
	@scripts/ros2-venv $(VENV) $*
	@touch $@

$(VENV)/bench.stamp: $(VENV)/dev.stamp scripts/debian-packages
	@scripts/debian-packages native qemu
	@$(PIP) install --group bench
	@touch $@

$(VENV)/docs.stamp: $(VENV)/dev.stamp
	@$(PIP) install --group docs
	@touch $@
