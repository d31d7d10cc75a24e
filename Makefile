# One command each, on a fresh clone as well as on an old one:
#
#   make demo       bend the cactus; mesh and pictures are written to demo-output/
#   make test       the whole suite            make campaign   the minutes-long runs
#   make soak       random input for an hour; SECONDS=900 for less
#   make lint       ruff, nothing changed      make format     ruff, files rewritten
#   make test-paraview   the plugin in a real ParaView
#   make test-lowest     the suite with the lowest versions that setup.cfg allows
#   make test-newest     and with the newest; TESTS=tests/io for a part of it
#   make docs       the documentation, docs/build/html/index.html
#   make drag-film  the animation of the README
#   make types      mypy --strict              make bench      a report of timings
#   make mutants    how many small faults in the code the tests find, in samples of each folder;
#                   FOLDER="mesh io" N=60 SEED=1 for some
#   make mutants-changed   the same for the lines changed since BASE=origin/main
#
# The first call makes a virtual environment in .venv; choose its Python with
# `make PYTHON=python3.12 test`.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip --quiet --disable-pip-version-check

# Draw without a window.  On a Linux machine without a screen, say so to VTK at once: it would
# try X first and warn about it once for every picture.
export PYVISTA_OFF_SCREEN ?= true
ifeq ($(shell uname -s)$(DISPLAY)$(WAYLAND_DISPLAY),Linux)
export VTK_DEFAULT_OPENGL_WINDOW ?= vtkEGLRenderWindow
endif

.PHONY: help demo test test-paraview test-lowest test-newest campaign soak mutants mutants-changed docs drag-film lint format types bench clean
help:
	@sed -n '3,16s/^# *//p' Makefile

demo: $(VENV)/installed
	$(BIN)/segdeform demo -o demo-output

bench: $(VENV)/installed
	$(BIN)/segdeform bench -o bench-output

# On two cores three workers take a tenth less time than two: some tests wait for other processes.
# Workers keep the tests of a file together, so that its fixtures are created once, and take over
# tests of others when they have finished.
test: $(VENV)/installed-test
	$(BIN)/python -m pytest -n 3 --dist worksteal

# In environments of their own.  uv reads the lowest versions from setup.cfg, which pip cannot do;
# no library is compiled.
TESTS ?= tests
test-lowest: export SEGDEFORM_LOWEST := true
test-lowest: resolution := lowest-direct
test-newest: resolution := highest
test-lowest test-newest: $(BIN)/python
	$(PIP) install uv
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python build/$@
	$(BIN)/uv pip install --quiet --python build/$@ --resolution $(resolution) \
	  --only-binary :all: --no-binary vtk-segdeform --editable '.[test,app,meshlab]'
	build/$@/bin/python -m pytest -n 2 --dist worksteal $(TESTS)

# In a real ParaView, whose own numpy and scipy may be too old: newer ones are put beside it.
test-paraview: build/paraview/installed
	SEGDEFORM_PARAVIEW=$(CURDIR)/build/paraview $(BIN)/python -m pytest tests/filters/test_paraview_plugin.py

build/paraview/installed: setup.cfg | $(VENV)/installed-test
	@command -v pvpython >/dev/null || { \
	  echo "There is no pvpython here. On Debian and Ubuntu:" \
	       "apt-get install paraview python3-paraview" >&2; exit 1; }
	$(PIP) install --target build/paraview --upgrade --only-binary=:all: --python-version \
	  `pvpython -c 'import sys; print("%d.%d" % sys.version_info[:2])'` numpy scipy
	@touch $@

campaign: $(VENV)/installed-test
	$(BIN)/python -m pytest -m campaign

SECONDS ?= 3600
soak: $(VENV)/installed-test
	SEGDEFORM_SOAK=$(SECONDS) $(BIN)/python -m pytest -m campaign -s tests/whole/test_soak.py -k hands

# Tested on copies of the tree: 60 mutants of a folder take some minutes on two cores.
N    ?= 30
SEED ?= 0
BASE ?= origin/main
mutants: $(VENV)/installed-test
	$(BIN)/python tests/support/mutants.py $(FOLDER) -n $(N) --seed $(SEED)

# Fails if less than 60 % are found: a few of them change nothing that a test could see.
mutants-changed: $(VENV)/installed-test
	$(BIN)/python tests/support/mutants.py $(FOLDER) -n $(N) --seed $(SEED) --base $(BASE) --least 60

# Pictures and gallery are drawn again where the code is newer.
docs: $(VENV)/installed-docs
	$(BIN)/python -m sphinx -q -W --keep-going -d docs/build/doctrees docs docs/build/html
	@echo "docs/build/html/index.html"

drag-film: $(VENV)/installed-docs
	PYTHONPATH=docs $(BIN)/python -m making.drag

lint: $(VENV)/installed-test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(VENV)/installed-test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# mypy cannot see that widgets/ is vtk_segdeform.widgets, so it is shown the tree as installed.
types: $(VENV)/installed-test
	@rm -rf build/types && mkdir -p build/types
	@cp -r vtk_segdeform build/types/ && cp -r widgets build/types/vtk_segdeform/widgets
	MYPYPATH=build/types $(BIN)/mypy -p vtk_segdeform

clean:
	rm -rf $(VENV) build dist demo-output *.egg-info .mypy_cache .pytest_cache .ruff_cache
	rm -rf docs/build docs/figures docs/gallery

# A stamp is older than setup.cfg when a dependency may have changed; then, and only then, pip runs.
# Bytecode of all that is installed would take pip longer than the rest; Python makes what it needs.
$(VENV)/installed: setup.cfg pyproject.toml | $(BIN)/python
	$(PIP) install --no-compile --editable .
	@touch $@

$(VENV)/installed-test: setup.cfg pyproject.toml | $(BIN)/python
	$(PIP) install --editable '.[test,app,meshlab]'
	@touch $@ $(VENV)/installed

$(VENV)/installed-docs: setup.cfg pyproject.toml | $(BIN)/python
	$(PIP) install --editable '.[docs]'
	@touch $@ $(VENV)/installed

$(BIN)/python:
	@command -v $(PYTHON) >/dev/null || { \
	  echo "There is no '$(PYTHON)' here. Install Python 3.10 or newer, or name one:" \
	       "make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' || { \
	  echo "$(PYTHON) is `$(PYTHON) --version 2>&1`; vtk_segdeform needs 3.10 or newer:" \
	       "make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) cannot make a virtual environment. On Debian and Ubuntu:" \
	       "apt-get install python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv --clear $(VENV)
