# Fresh machine: `make run` and `make test` need nothing but Python 3.11 or newer and make.
PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/installed

.PHONY: run test test-slow coverage check mutants docs site results clean

run: $(INSTALLED)
	$(BIN)/shaftline tour --out out/tour

test: $(INSTALLED)
	$(BIN)/python -m pytest -n auto -m "not slow"

test-slow: $(INSTALLED)
	$(BIN)/python -m pytest -n auto -m slow

# which lines of Python no fast test visits; compiled kernels are not counted
coverage: $(INSTALLED)
	$(BIN)/python -m pytest -n auto -m "not slow" --cov --cov-report=term-missing

check: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	mkdir -p .venv/source && ln -sfn "$(CURDIR)" .venv/source/shaftline
	MYPYPATH=.venv/source $(BIN)/mypy -p shaftline
	MYPYPATH=.venv/source $(BIN)/mypy tests

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
	$(BIN)/python -m shaftline.studies.loops --out docs/results
	$(BIN)/python -m shaftline.studies.ferry.engine_map --out docs/results
	$(BIN)/python -m shaftline.studies.errata --out docs/results
	$(BIN)/python -m shaftline.studies.adaptive_gains --out docs/results
	$(BIN)/python -m shaftline.studies.towing_tank.observers --out docs/results
	$(BIN)/python -m shaftline.studies.observer_ranking --out docs/results
	$(BIN)/python -m shaftline.studies.observer_features --out docs/results
	$(BIN)/python -m shaftline.studies.intervals --out docs/results
	$(BIN)/python -m shaftline.studies.learners.reward_terms --out docs/results/figures/reward-terms.png
	$(BIN)/python -m shaftline.studies.speed --out docs/results/speed.md
	$(BIN)/python -m shaftline.studies.tito_neri.effects --out docs/results
	$(BIN)/python -m shaftline.studies.tito_neri.rig_page --out docs/results
	@# recordings are their owners' and stay outside; SHAFTLINE_DATA is the folder that holds them
	if [ -d "$(SHAFTLINE_DATA)/recordings/emps" ]; then \
	    $(BIN)/python -m shaftline.studies.emps --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings/emps"; fi
	if [ -d "$(SHAFTLINE_DATA)/recordings/dc_motor_generator" ]; then \
	    $(BIN)/python -m shaftline.studies.rigs --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings"; fi
	if [ -d "$(SHAFTLINE_DATA)/recordings/esso_osaka" ]; then \
	    $(BIN)/python -m shaftline.studies.esso_osaka_model --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings/esso_osaka"; fi
	if [ -d "$(SHAFTLINE_DATA)/recordings/rov_thruster" ]; then \
	    $(BIN)/python -m shaftline.studies.rov_thruster --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings/rov_thruster"; fi
	if [ -d "$(SHAFTLINE_DATA)/recordings/kvlcc2_hsva" ]; then \
	    $(BIN)/python -m shaftline.studies.kvlcc2 --out docs/results \
	        --recordings "$(SHAFTLINE_DATA)/recordings/kvlcc2_hsva"; fi

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install -qq --disable-pip-version-check --upgrade pip -c constraints.txt
	$(BIN)/python -m pip install -qq --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $(INSTALLED)

clean:
	rm -rf .venv out build dist *.egg-info
