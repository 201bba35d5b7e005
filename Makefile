# make demo    ROS 2 nodes under striped light: a line an image, annotated pictures in demo/
#              DEMO='--light lattice --detector traditional' and so on; ahf_demo --help tells all
# make test    every check: ruff, mypy, the import rules, the tests
# Both set up .venv first; nothing is installed outside it.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready

# What a sourced ROS installation or another environment left behind does not belong in this one.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: demo test clean
.DELETE_ON_ERROR:

demo: $(READY)
	$(BIN)/ahf_demo $(DEMO)

test: $(READY)
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest

clean:
	rm -rf $(VENV) build

# The modules are used where they are; only the interfaces are generated and compiled.
$(READY): pyproject.toml setup.py package.xml CMakeLists.txt $(wildcard msg/*.msg srv/*.srv)
	@$(PYTHON) scripts/prerequisites.py
	@echo 'Setting up $(VENV): ROS 2 from PyPI, and the messages compiled; takes 1 to 3 minutes.'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@
