# make demo    ROS 2 nodes identify one striped image in three ways: a line each, a picture in demo/
#              DEMO='--light lattice --ambient 0.12' and so on; ahf_demo --help lists all options
# make test    every check: ruff, mypy, the import rules, the tests; then the tests that need no
#              ROS once more with the oldest versions, and once more on other vector units
# Both set up .venv first; nothing is installed outside it. DISTRIBUTION=kilted takes the wheels of
# ROS 2 Kilted instead of Jazzy, into .venv-kilted. make --jobs=2 test uses two cores.

PYTHON ?= python3
DISTRIBUTION ?= jazzy
VENV ?= .venv$(if $(filter-out jazzy,$(DISTRIBUTION)),-$(DISTRIBUTION))
BIN := $(VENV)/bin
READY := $(VENV)/ready
export AHF_ROS_DISTRIBUTION := $(DISTRIBUTION)

# The first Python that is there is the oldest that numpy and OpenCV of test/oldest.txt are for.
OLDEST_PYTHON ?= $(firstword $(foreach name,python3.10 python3.11,$(shell $(name) -c '' 2>/dev/null && echo $(name))) $(PYTHON))
OLDEST := .venv-oldest

# What a sourced ROS installation or another environment left behind does not belong in this one.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

.PHONY: demo test lint test-native test-portable test-oldest test-kilted clean
.DELETE_ON_ERROR:

demo: $(READY)
	$(BIN)/ahf_demo $(DEMO)

test: test-native test-portable test-oldest lint

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

test-native: $(READY)
	$(BIN)/python -m pytest

# Bags, nodes and the command line compute nothing of their own.
SHARED = --ignore test/benchmarks --ignore test/bag --ignore test/cli

# No vector units beyond those that numpy and OpenCV were compiled for: other last bits.
test-portable: $(READY)
	$(BIN)/python -m support.vector_units baseline $(BIN)/python -m pytest \
		$(SHARED) --ignore test/nodes --ignore test/test_every_way.py

# The oldest versions of numpy and OpenCV that are to be had, no ROS, and no AVX-512.
test-oldest: $(OLDEST)/ready
	$(OLDEST)/bin/python -m support.vector_units avx2 $(OLDEST)/bin/python -m pytest \
		$(SHARED)

# The nodes on ROS 2 Kilted.
test-kilted:
	$(MAKE) DISTRIBUTION=kilted .venv-kilted/ready
	.venv-kilted/bin/python -m pytest $$(grep -lrE 'rclpy|graph: ' test --include='test_*.py')

clean:
	rm -rf .venv* build

# The modules are used where they are; only the interfaces are generated and compiled.
$(READY): pyproject.toml setup.py distributions.ini package.xml CMakeLists.txt \
		$(wildcard msg/*.msg srv/*.srv)
	@$(PYTHON) scripts/prerequisites.py
	@echo 'Setting up $(VENV): ROS 2 from PyPI, and the messages compiled; takes 1 to 3 minutes.'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@

$(OLDEST)/ready: test/oldest.txt
	$(OLDEST_PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install --quiet --disable-pip-version-check --requirement $<
	touch $@
