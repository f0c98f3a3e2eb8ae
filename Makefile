# Fresh machine: `make run` and `make test` need nothing but Python 3.11 or newer and make.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/installed
PREPARED := .venv/prepared

.PHONY: run test test-slow coverage check mutants docs site results wheel clean

run: $(PREPARED)
	$(BIN)/shaftline tour --out out/tour

test: $(PREPARED)
	@echo "About 11,700 tests in twenty-five minutes on two cores."
	$(BIN)/python -m pytest -n auto --dist worksteal -m "not slow"

test-slow: $(PREPARED)
	$(BIN)/python -m pytest -n auto --dist worksteal -m slow

# which lines of Python no fast test visits; compiled kernels are not counted
coverage: $(INSTALLED)
	$(BIN)/python -m pytest -n auto -m "not slow" --cov --cov-report=term-missing

check: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	mkdir -p .venv/source && ln -sfn "$(CURDIR)" .venv/source/shaftline
	MYPYPATH=.venv/source $(BIN)/mypy -p shaftline
	ln -sfn "$(CURDIR)/reproductions" .venv/source/reproductions
	MYPYPATH=.venv/source $(BIN)/mypy -p reproductions
	MYPYPATH=.venv/source $(BIN)/mypy tests
	$(BIN)/python -m tests.words

# small wrong changes to the code, one at a time: which do the tests notice? (about an hour; resumes)
mutants: $(INSTALLED)
	$(BIN)/python -m tests.mutants --out docs/results/mutants.md

docs: $(INSTALLED)
	$(BIN)/shaftline list --markdown docs/reference.md

# the site, its notebooks run: open out/site/index.html
site: $(INSTALLED)
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[docs]'
	$(BIN)/python docs/build.py --out out/site

# every number and figure in docs/results
results: $(INSTALLED)
	$(BIN)/shaftline reproduce all --out docs/results
	$(BIN)/shaftline tour --out docs/results/tour
	$(BIN)/shaftline evaluate --out docs/results/baselines --task transit --seeds 20 \
	    --controller combinator --controller cpp-optimiser --controller anti-spin \
	    --sea calm --sea state-3 --sea state-5 --sea state-6 --observer all
	$(BIN)/shaftline video combinator va-pitch --task rough-sea:held-out --seed 900002 \
	  --out docs/results/figures/film.gif
	$(BIN)/shaftline manoeuvre --ship kvlcc2 --speed 1.18 --scale 45.7 --out out/kvlcc2
	cp out/kvlcc2/turning-circles.png docs/results/figures/turning-circles.png
	for name in printed_numbers loops ferry.engine_map ferry.propellers errata towing_tank.observers observer_ranking \
	    advance_velocity_control robust_optimiser anti_spin_ships observer_features intervals adaptive_noise tito_neri.effects \
	    tito_neri.rig_page standards speed_loss \
	    speed_loss_causes voyages frontier; do \
	    $(BIN)/python -m reproductions $$name --out docs/results || exit 1; done
	$(BIN)/python -m reproductions learners.reward_terms --out docs/results/figures/reward-terms.png
	$(BIN)/python -m reproductions speed --out docs/results/speed.md
	if [ -e /dev/nvidia0 ]; then $(BIN)/python -m reproductions gpu --out docs/results || exit 1; fi
	@# recordings are their owners' and stay outside; SHAFTLINE_DATA is the folder that holds them
	if [ -d "$(SHAFTLINE_DATA)/recordings" ]; then \
	    $(BIN)/python -m reproductions rigs --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings" || exit 1; \
	    for pair in emps:emps esso_osaka_model:esso_osaka rov_thruster:rov_thruster \
	        kvlcc2:kvlcc2_hsva; do \
	        folder="$(SHAFTLINE_DATA)/recordings/$${pair#*:}"; \
	        if [ -d "$$folder" ]; then $(BIN)/python -m reproductions $${pair%:*} \
	            --out docs/results --recordings "$$folder" || exit 1; fi; done; fi

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -qq --disable-pip-version-check --upgrade pip -c constraints.txt
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $(INSTALLED)

# compile the equations on all cores; other targets need none
$(PREPARED): $(INSTALLED)
	$(BIN)/shaftline prepare
	touch $(PREPARED)

# a wheel with the machine code of the usual commands, for processors since about 2013 and this Python
KERNELS = find . -path ./.venv -prune -o -name '*.nb[ic]' -print
wheel: $(INSTALLED)
	$(KERNELS) | xargs rm -f $(PREPARED)
	NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES= $(BIN)/shaftline prepare
	$(BIN)/python -m build --wheel --outdir dist \
	    -C--build-option=--python-tag=$$($(BIN)/python -c 'import sys; print("cp%d%d" % sys.version_info[:2])') \
	    -C--build-option=--plat-name=$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_platform())')
	$(KERNELS) | xargs rm -f

clean:
	rm -rf .venv out build dist *.egg-info
