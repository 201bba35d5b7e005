# make demo    one striped image is identified in three ways: a line each, a picture in demo/
#              DEMO='--light lattice --ambient 0.12' and so on; ahf demo --help lists all options
# make nodes   ROS 2 from PyPI, and the five nodes: ahf_detector, ahf_illumination and others
# make test    every check: ruff, mypy, the import rules, the site, the tests; then the tests that
#              need no ROS with the oldest versions and without the processor's vector units
# make test-colcon  the tests as colcon runs them, for once a week: half an hour
# make wheels  a wheel for each system and processor that kernels are compiled for, in dist/
# make site    the documentation as a site, build/site/index.html
# All set up .venv first, with what they need; nothing is installed outside it.
# DISTRIBUTION=kilted takes the wheels of ROS 2 Kilted instead of Jazzy, into .venv-kilted.
# make --jobs=2 test uses two cores.

PYTHON ?= python3
DISTRIBUTION ?= jazzy
VENV ?= .venv$(if $(filter-out jazzy,$(DISTRIBUTION)),-$(DISTRIBUTION))
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
NODES := $(VENV)/nodes
READY := $(VENV)/ready
QUIET := --quiet --disable-pip-version-check
PIP := $(BIN)/python -m pip install $(QUIET)
export AHF_ROS_DISTRIBUTION := $(DISTRIBUTION)
# Python compiles a module when it is first imported; pip would compile also what nobody imports.
export PIP_COMPILE := 0

# The site is built and reports are opened in a browser once, on Jazzy.
COMMA := ,
EXTRAS := test$(if $(filter jazzy,$(DISTRIBUTION)),$(COMMA)docs$(COMMA)test-browser)

# The first Python that is there is the oldest that numpy and OpenCV of test/oldest.txt are for.
OLDEST_PYTHON ?= $(firstword $(foreach name,python3.10 python3.11,$(shell $(name) -c '' 2>/dev/null && echo $(name))) $(PYTHON))
OLDEST := .venv-oldest

# The compiler, from PyPI, that compiles for all systems.
WHEELS := .venv-wheels

# What a sourced ROS installation or another environment left behind does not belong in this one.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Hundreds of processes would each compile all modules again: 0.5 of the 1 s that `ahf` takes then.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo nodes wheels test lint site test-native test-live test-detectors test-files \
	test-commands test-computing coverage test-oldest test-portable test-sanitized test-aarch64 \
	test-kilted test-colcon yardstick browser clean
.DELETE_ON_ERROR:

demo: $(INSTALLED)
	$(BIN)/ahf demo $(DEMO)

nodes: $(NODES)

# The longest first, so that none ends alone: two cores end at the same time.
test: test-computing test-detectors test-live test-oldest coverage yardstick lint site \
	test-portable test-sanitized test-aarch64

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

site: $(READY)
	$(BIN)/python scripts/build_site.py build/site

test-native: test-live test-detectors test-files test-commands test-computing

# What runs nodes, what identifies targets in many images, what reads and writes files, what runs
# commands, and the rest.
LIVE = test/nodes test/test_every_way.py
DETECTORS = test/benchmarks test/families
FILES = test/base test/clouds test/files test/test_readers.py \
	$(wildcard test/network/*_files.py test/network/test_*export*.py)
COMMANDS = test/bag test/batch test/cli

test-live: $(READY)
	$(BIN)/python -m pytest $(LIVE)

test-detectors: $(READY)
	$(BIN)/python -m pytest $(DETECTORS)

test-computing: $(READY) | $(if $(CI),browser)
	$(BIN)/python -m pytest $(patsubst %,--ignore %,$(LIVE) $(DETECTORS) $(FILES) $(COMMANDS))

test-commands: $(READY)
	$(BIN)/coverage run -m pytest $(COMMANDS)

test-files: $(READY)
	$(BIN)/coverage run -m pytest $(FILES)

# Lines and branches of what reads and writes files that these two run, in their own processes.
coverage: test-commands test-files
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

# Pictures that this package did not render, beside the checkout: no change reads less of them,
# reports more that is wrong or false, or makes more calls than the record. With UPDATE=1 what is
# better goes into the record.
YARDSTICK := ../shared/yardstick/score.py

yardstick: $(READY)
ifneq ($(wildcard $(YARDSTICK)),)
	$(BIN)/python $(YARDSTICK) --record benchmarks/yardstick.json $(if $(UPDATE),--update)
else
	@echo 'No pictures are at $(YARDSTICK): the yardstick is left out.'
endif

# Reports are tested in Chromium. CI installs it where it can; elsewhere the test skips without it.
browser:
	@command -v chromedriver >/dev/null || support/install_browser.sh

# Bags, batches, nodes and the command line compute nothing of their own.
SHARED = --ignore test/benchmarks --ignore test/bag --ignore test/batch --ignore test/cli

# The oldest versions of numpy and OpenCV that are to be had, and no ROS. No vector units beyond
# those that both were compiled for: other last bits than those of the tests above. What lasts long
# is tested with the newest versions only. The kernels are those that $(VENV) has compiled.
test-oldest: $(OLDEST)/ready $(INSTALLED)
	$(OLDEST)/bin/python -m support.vector_units baseline $(OLDEST)/bin/python -m pytest \
		-m 'not lasting' $(SHARED)

# What the oldest OpenCV does not have, without those vector units.
test-portable: $(READY)
	$(BIN)/python -m support.vector_units baseline $(BIN)/python -m pytest \
		-m 'not lasting' test/families/test_square.py test/families/test_edges.py

# The kernels with checks of every access to memory, and of arithmetic that C leaves undefined.
SANITIZED := build/sanitized.bin

test-sanitized: $(READY)
	mkdir -p build
	$(BIN)/python scripts/build_kernels.py $(SANITIZED) -g -O1 \
		-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all
	AHF_ROS_KERNELS=$(abspath $(SANITIZED)) ASAN_OPTIONS=detect_leaks=0 \
		LD_PRELOAD="$$($${CC:-cc} -print-file-name=libasan.so)" \
		$(BIN)/python -m pytest test/kernels

# The same bits on another processor: qemu-user emulates it, zig compiles for it.
EMULATED := build/aarch64

ifneq ($(shell command -v qemu-aarch64),)
test-aarch64: $(READY) $(WHEELS)/ready
	mkdir -p build
	$(BIN)/python -m support.emulated >$(EMULATED).c
	$(WHEELS)/bin/python -m ziglang cc -target aarch64-linux-musl -static -Iahf_ros/kernels \
		@ahf_ros/kernels/compile_flags.txt ahf_ros/kernels/*.c $(EMULATED).c -o $(EMULATED)
	$(BIN)/python -m pytest test/kernels --emulated 'qemu-aarch64 $(abspath $(EMULATED))'
else
test-aarch64:
	@echo 'There is no qemu-aarch64 (apt install qemu-user): kernels are not tested on aarch64.'
endif

# What talks to ROS 2, on Kilted, with no more installed than that needs; what lasts long does so on
# Jazzy only.
test-kilted:
	$(MAKE) DISTRIBUTION=kilted .venv-kilted/nodes
	.venv-kilted/bin/python -m pip install $(QUIET) 'ahf_ros[bag]' hypothesis pytest
	.venv-kilted/bin/python -m pytest -m 'not lasting' \
		$$(grep -lrE 'rclpy|graph: ' test/bag test/clouds test/files test/nodes \
			--include='test_*.py')

wheels: $(WHEELS)/ready
	for platform in $$($(WHEELS)/bin/python scripts/build_kernels.py --platforms); do \
		$(WHEELS)/bin/python -m pip wheel $(QUIET) --no-deps --no-build-isolation --wheel-dir dist \
			--config-settings=--build-option=--plat-name=$$platform . || exit; \
	done

# With ROS 2 from PyPI; where one is sourced, run the script itself.
test-colcon:
	env --unset=ROS_DISTRO test/colcon.sh build/colcon

clean:
	rm -rf .venv* build .coverage*

# The modules are used where they are. The pip that comes with Python 3.11 takes twice as long as
# today's to choose versions.
$(INSTALLED): pyproject.toml setup.py package.xml scripts/build_kernels.py $(wildcard ahf_ros/kernels/*)
	@$(PYTHON) scripts/prerequisites.py
	@echo 'Setting up $(VENV): numpy, OpenCV and what else the command line needs.'
	$(PYTHON) -m venv $(VENV)
	$(PIP) --upgrade pip
	$(BIN)/python -m pip install --disable-pip-version-check --editable .
	touch $@

$(NODES): $(INSTALLED) ros/setup.py ros/pyproject.toml distributions.ini CMakeLists.txt \
		$(wildcard msg/*.msg srv/*.srv)
	@$(PYTHON) scripts/prerequisites.py nodes
	@echo 'Adding ROS 2 from PyPI to $(VENV), and compiling the messages; takes 1 to 3 minutes.'
	$(PIP) ./ros
	touch $@

# What only checks need.
$(READY): $(NODES)
	@echo 'Adding what the checks need to $(VENV).'
	$(PIP) 'ahf_ros[$(EXTRAS)]'
	touch $@

$(OLDEST)/ready: test/oldest.txt
	$(OLDEST_PYTHON) -m venv $(OLDEST)
	$(OLDEST)/bin/python -m pip install $(QUIET) --upgrade pip
	$(OLDEST)/bin/python -m pip install $(QUIET) --requirement $<
	touch $@

$(WHEELS)/ready:
	$(PYTHON) -m venv $(WHEELS)
	$(WHEELS)/bin/python -m pip install $(QUIET) 'setuptools>=77' ziglang
	touch $@
