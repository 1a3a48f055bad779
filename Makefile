# `make demo` flies the demo, `make test` runs every test, `make lint` the linter and the type checker.
# Each makes the virtual environment that it needs; nothing is installed outside this folder.

PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { echo $$p; break; }; done)
DEMO := .venv-demo
DEV := .venv-dev
DEMO_SECONDS ?= 60

.PHONY: demo test lint format clean
.DELETE_ON_ERROR:

define make_environment
	@test -n "$(PYTHON)" || { echo "uavdepth needs Python 3.11 or newer; none was found on PATH." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "$(PYTHON) cannot make virtual environments. On Debian or Ubuntu: sudo apt install python3-venv" >&2; exit 1; }
	@echo "Making the environment $(1) (once; this downloads packages) ..."
	@$(PYTHON) -m venv $(1)
	@$(1)/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[$(2)]'
	@touch $@
endef

$(DEMO)/.ready: pyproject.toml constraints.txt
	$(call make_environment,$(DEMO),sim$(comma)openvino)

$(DEV)/.ready: pyproject.toml constraints.txt
	$(call make_environment,$(DEV),sim$(comma)train$(comma)dev)

comma := ,

demo: $(DEMO)/.ready
	@$(DEMO)/bin/uavdepth demo --seconds $(DEMO_SECONDS) --output demo_out

# The tests of the service live in real time: one after the other. The rest needs nothing but processors; the
# tests of a file stay in one process, for they share worlds and recordings.
test: $(DEV)/.ready
	@status=0; \
	$(DEV)/bin/python -m pytest tests/service || status=1; \
	$(DEV)/bin/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder --ignore tests/service || status=1; \
	exit $$status

lint: $(DEV)/.ready
	$(DEV)/bin/ruff check .
	$(DEV)/bin/ruff format --check .
	$(DEV)/bin/mypy

format: $(DEV)/.ready
	$(DEV)/bin/ruff check --fix .
	$(DEV)/bin/ruff format .

clean:
	rm -rf $(DEMO) $(DEV) demo_out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
