# The two commands, and what they need. `make drive` and `make test` set up whatever is missing.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python

NATIVE := CMakeLists.txt pyproject.toml $(wildcard firmware/src/*.[ch] host/*/*_core/*.[ch]pp host/*/core/*.[ch]pp)

.PHONY: drive test setup firmware flash budget check avr clean

drive: build/ready
	$(RUN) host/nav_loop.py --view

# Two processes; tests/conftest.py says which tests keep together, and in which order.
test: build/ready-for-tests
	$(RUN) -m pytest -n 2 --no-loadscope-reorder

setup: build/ready

build/ready: tools/setup $(NATIVE)
	@PYTHON=$(PYTHON) tools/setup

build/ready-for-tests: build/ready
	@PYTHON=$(PYTHON) tools/setup tests

# The ATmega's program, and the simulator that runs it: both need tools/setup_avr once.
firmware:
	$(PYTHON) tools/build_firmware.py

# make flash PORT=/dev/ttyACM0 [BOARD=nano]
BOARD ?= uno
flash: build/ready
	$(RUN) tools/flash_firmware.py "$(PORT)" --board $(BOARD)

# What it takes of the processor, measured in the simulator, and a million edges counted; fails above what it may take.
budget: build/ready-for-tests
	$(RUN) tools/firmware_budget.py
	EDGES=1000000 $(RUN) -m pytest tests/firmware/avr/test_avr_counting.py

# Static analysis.
check:
	$(PYTHON) tools/check_firmware.py

avr: firmware
	$(PYTHON) tools/build_rig.py

clean:
	rm -rf build $(VENV)
