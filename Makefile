# Everything a newcomer needs: make demo, make test. PYTHON chooses the interpreter (3.11 or 3.12).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PACKAGES := par4_kinematics par4_dynamics par4_sim par4_identification

# nothing of a sourced ROS installation or of the caller's Python may leak into the environment
unexport PYTHONPATH
unexport PYTHONHOME
# every process that tests start would compile the modules anew
unexport PYTHONDONTWRITEBYTECODE

# of each room what needs no diagnosis, no engine and no nodes: a minute on two cores
QUICK := amplifier api bag drive dynamics filtering kinematics log log_table motions noise numbering \
  pace reach reference_curve ros_convert sensors serialised_trajectory stretches structure table_bag \
  transmission

.PHONY: help setup demo test quick fuzz lint bench blind setup_study site docs clean

help:
	@echo 'make demo   install and run the main job end to end (results in demo_output/)'
	@echo 'make test   install and run the tests'
	@echo 'make quick  run those of the tests that take a minute together'
	@echo 'make fuzz   give every reader of outside data 2,000 inputs at their worst (half an hour)'
	@echo 'make setup  install into $(VENV) only'
	@echo 'make bench  measure accuracy and speed'
	@echo 'make setup_study  make mistakes of the setup and count what is told: docs/setup_study.md'
	@echo 'make blind  hide effects and count what is found: docs/blind_study.md (hours; ARGUMENTS=...)'
	@echo 'make lint   check style and types'
	@echo 'make site   build the site of the documentation into build/site'
	@echo 'make docs   regenerate the pages of interface, files and effects, parameter files and layouts'
	@echo 'make clean  remove what the above made'

# numba notices that the file of a kernel has changed, not that one has whose kernels it calls
KERNELS := $(shell grep -rl numba.njit src tests --include='*.py')

setup: $(VENV)/.compiled

$(VENV)/.installed: requirements.txt constraints.txt $(PACKAGES:%=src/%/setup.py)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] not in ((3, 11), (3, 12)))' || \
	  { echo 'error: Python 3.11 or 3.12 is needed, $(PYTHON) is '`$(PYTHON) --version`'; run make PYTHON=python3.11'; exit 2; }
	@echo 'installing into $(VENV): about 850 MB, a minute or two (on Python 3.12 pybullet is built from source, about 8 minutes more)'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements.txt -c constraints.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation \
	  $(PACKAGES:%=-e src/%)
	@touch $@

$(VENV)/.compiled: $(VENV)/.installed $(KERNELS)
	@echo 'compiling the numeric kernels, once: a minute'
	@find src tests -name '*.nb[ic]' -delete
	$(BIN)/python demo/compile_kernels.py
	@touch $@

demo: setup
	$(BIN)/python demo/demo.py

test: setup
	$(BIN)/python -m pytest

quick: setup
	$(BIN)/python -m pytest $(QUICK:%=tests/test_%.py)

fuzz: setup
	$(BIN)/python -m pytest tests/test_fuzz.py --hypothesis-profile=fuzz --timeout=3600

lint: setup
	$(BIN)/ruff check src tests demo bench examples site
	$(BIN)/mypy

bench: setup
	$(BIN)/python bench/bench.py

blind: setup
	$(BIN)/python bench/blind_study.py $(ARGUMENTS)

setup_study: setup
	$(BIN)/python bench/setup_study.py $(ARGUMENTS)

site: setup
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements-site.txt -c constraints.txt
	$(BIN)/python site/build.py

docs: setup
	$(BIN)/python -m par4_kinematics.interface > docs/interface.md
	$(BIN)/python -m par4_kinematics.robot_file > docs/robot_file.md
	$(BIN)/python -m par4_kinematics.motion_recipes > docs/motion_file.md
	$(BIN)/python -m par4_dynamics.model_keys > docs/model_file.md
	$(BIN)/python -m par4_dynamics.effects.catalogue > docs/effects.md
	$(BIN)/python -m par4_sim.cell.layouts src/par4_sim/layouts
	$(BIN)/python site/manifests.py
	$(BIN)/par4_kinematics --config > src/par4_kinematics/config/par4_kinematics.yaml
	$(BIN)/par4_motion --config > src/par4_kinematics/config/par4_motion.yaml
	$(BIN)/par4_feedforward --config > src/par4_dynamics/config/par4_feedforward.yaml
	$(BIN)/par4_simulation --config > src/par4_sim/config/par4_simulation.yaml
	$(BIN)/par4_record --config > src/par4_identification/config/par4_record.yaml
	$(BIN)/par4_monitor --config > src/par4_identification/config/par4_monitor.yaml

clean:
	rm -rf $(VENV) demo_output build install log .pytest_cache .ruff_cache .mypy_cache
	find src tests -name __pycache__ -prune -exec rm -rf {} +
	find src -name '*.egg-info' -prune -exec rm -rf {} +
