"""What the search of formulas finds in a case, beside what the true form would have gained."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from shaftline.mismatch.judge.held_out import HeldOut
from shaftline.mismatch.options import Options
from shaftline.mismatch.pipeline import diagnose
from shaftline.mismatch.recordings.joint import load_jointly
from shaftline.mismatch.search.catalogue import applicable
from shaftline.mismatch.search.formulas import FormulaSearch, SetAside, found_formula
from shaftline.mismatch.setting import Settings
from shaftline.plant.expressions import names_in
from shaftline.plant.terms import TERM_SIGNALS

from .cases import Case, nominal, recorded


def searched(case: Case) -> dict[str, Any]:
    """The search alone, in every balance, without the catalogue before it.

    Of nulls that is harder than a diagnosis, which asks first whether more than noise is left.
    """
    with threadpool_limits(1, "blas"):
        return _searched(case)


def _searched(case: Case) -> dict[str, Any]:
    ship, options = nominal(case.rig), Options()
    together = load_jointly(ship, [recorded(case)], signals=options.signals)
    effects = applicable(ship, set(together.tables[0].columns))
    setting = Settings(ship, together, effects, 1.0).best
    fitter = setting.fitter
    begin = time.perf_counter()
    search = FormulaSearch(fitter, fitter.null, fitter.balances.names)
    rows = np.concatenate([np.arange(a, b) for a, b in setting.held])
    aside = SetAside(HeldOut(fitter, setting.held), rows)
    formula = found_formula(search, aside)
    found: dict[str, Any] = {
        "case": case.name, "rig": case.rig, "seed": case.seed, "wrong_numbers": case.wrong,
        "tried": search.count, "seconds": time.perf_counter() - begin,
        "coloured": ", ".join(setting.whiteness.coloured(fitter.null)),
        "formula": "" if formula is None else f"{formula.term.acts_on}: {formula.term.expression}",
        "signals": [] if formula is None else sorted(formula.signals),
        "gain": 0.0 if formula is None else formula.gain,
        "held_out": 0.0 if formula is None else formula.held_out,
        "threshold": search.threshold(1) if formula is None else formula.threshold,
        "rivals": [] if formula is None else list(formula.rivals),
    }  # fmt: skip
    if case.truth is None:
        return found
    signals = sorted(
        {n for n in names_in(case.truth.expression) if n in TERM_SIGNALS or n in ship.signals}
    )
    start = [p.value for p in case.truth.parameters.values()]
    true = search.of_term(case.truth.model_copy(update={"id": "truth"}), (), start)
    assert true is not None
    record = fitter.trial_ship.record
    possible = aside.judge(record(true.fit.effects)) - aside.judge(record(()))
    return found | {
        "truth": f"{case.truth.acts_on}: {case.truth.expression}",
        "true_signals": signals,
        "right_signals": found["signals"] == signals,
        "possible": true.gain,
        "possible_held_out": possible,
    }


def diagnosed(case: Case) -> dict[str, Any]:
    """The whole diagnosis, the catalogue first."""
    begin = time.perf_counter()
    found = diagnose(nominal(case.rig), recorded(case), options=Options(quick=True))
    return {
        "case": case.name,
        "verdict": found.verdict,
        "named": [f.effect.label for f in found.findings],
        "formula": None if found.formula is None else found.to_dict()["formula"],
        "held_out": found.held_out_gain,
        "seconds": time.perf_counter() - begin,
    }
