# make sweep   sets everything up in .venv and runs the first sweep
# make test    sets up what the tests need and runs them all
# make devices installs further OpenCL drivers for the CPU, as far as that is possible here
# make kit     makes a folder that sets freepath up where there is no package index, and tries it
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# what wheels of the kit are for: the Python of .venv, unless another one is named (3.12)
KIT_PYTHON ?=
KIT_OPTIONS ?=

.PHONY: sweep test test-slow devices kit lint schema clean

sweep: $(VENV)/installed
	$(BIN)/python -m freepath.extras.device_setup --if-needed
	$(BIN)/freepath run quick

test: $(VENV)/installed-for-tests
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not slow"

# Those that take long: of all drivers, planted defects, pictures, new trackers and large tables.
test-slow: $(VENV)/installed-for-tests
	$(BIN)/python -m pytest -n auto --dist loadfile -m slow

# OpenCL drivers that need no special hardware: by apt where this is root, and by pip. What cannot be
# had is said, and the others are installed all the same.
devices: $(VENV)/installed
	$(BIN)/python -m freepath.extras.device_setup

kit: $(BIN)/python
	$(BIN)/python packaging/make_kit.py kit $(if $(KIT_PYTHON),--python $(KIT_PYTHON)) $(KIT_OPTIONS)

lint: $(VENV)/installed-for-tests
	$(BIN)/ruff check setup.py harness tests
	$(BIN)/ruff format --check setup.py harness tests
	$(BIN)/mypy
	$(BIN)/python tests/lines.py

schema: $(VENV)/installed
	$(BIN)/freepath schema -o configs/schema.json
	$(BIN)/python -m freepath.results.columns docs/notation.md
	$(BIN)/python -c 'from freepath.show.glossary import markdown; print(end=markdown())' > docs/glossary.md

# Debian's python3 has venv only with the package python3-venv, whose installation takes root;
# virtualenv does the same from the package index.
$(BIN)/python:
	$(PYTHON) -m venv $(VENV) || ( \
	  rm -rf $(VENV) && \
	  $(PYTHON) -m pip install --quiet --target $(VENV)-maker virtualenv && \
	  PYTHONPATH=$(VENV)-maker $(PYTHON) -m virtualenv --quiet $(VENV) )

$(VENV)/installed: $(BIN)/python setup.cfg pyproject.toml setup.py
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[pocl,report]'
	touch $@

$(VENV)/installed-for-tests: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[test]'
	touch $@

clean:
	rm -rf $(VENV) $(VENV)-maker kit build dist *.egg-info harness/*.egg-info
