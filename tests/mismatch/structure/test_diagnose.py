"""A diagnosis by the structure search, from recordings to report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shaftline.mismatch import Diagnosis, Options, diagnose
from shaftline.mismatch.simulate.balances import RunawayError
from shaftline.mismatch.structure.diagnose import NO_BASE
from shaftline.mismatch.structure.model import Model
from shaftline.mismatch.structure.search import StructureSearch
from shaftline.plant import load_ship
from shaftline.plant.replay import simulate_recording

from .rigs import COULOMB, INERTIA, motor, run

OTHERS = (
    "direction-asymmetry",
    "torque-offset",
    "quadratic-drag",
    "supply-limit",
    "speed-sensor-delay",
    "braking-loss",
    "command-dead-zone",
    "load-friction",
)
OPTIONS = Options(exclude=OTHERS)


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    """Dry friction that the file lacks, and an inertia that is wrong by a quarter."""
    truth = {COULOMB: 0.03, INERTIA: 1.25e-3}
    return diagnose(
        motor(), run(truth, 1), run(truth, 3), hold_out=[run(truth, 2)], options=OPTIONS
    )


def test_friction_is_identified_and_the_inertia_estimated(found: Diagnosis) -> None:
    assert [f.effect.id for f in found.findings] == ["coulomb-friction"]
    estimate = found.findings[0].estimates[0]
    assert estimate.value == pytest.approx(0.03, rel=0.05)
    low, high = estimate.ci95
    assert low < 0.03 < high
    assert found.findings[0].score > 5.0 * found.findings[0].threshold
    (number,) = found.parameters
    assert number.key == INERTIA
    assert number.value == pytest.approx(1.25e-3, rel=0.05)
    assert number.shifts > 30.0


def test_the_ranking_has_the_gain_of_each_effect_alone(found: Diagnosis) -> None:
    (finding,) = found.findings
    own = next(row for row in found.ranking if row[0].effect is finding.effect)
    assert own[0].gain == pytest.approx(finding.score, rel=0.01)
    assert own[1] == finding.threshold
    gains = [candidate.gain for candidate, _ in found.ranking]
    assert gains == sorted(gains, reverse=True)
    # All candidates were tried, although screening fits the best ones alone.
    assert len(found.tried) > len(found.ranking)


def test_a_parameter_beyond_its_tolerance_leaves_the_verdict_partly(found: Diagnosis) -> None:
    assert found.verdict == "partly-explained"
    assert any("the value or its tolerance in the ship file is wrong" in w for w in found.warnings)
    (why,) = (w for w in found.warnings if w.startswith("explained in part only"))
    assert why.endswith(f"because {INERTIA} moved far from the ship file")
    wide = motor().with_values({"tolerances.inertia": 0.3})
    truth = {COULOMB: 0.03, INERTIA: 1.25e-3}
    sure = diagnose(wide, run(truth, 1), run(truth, 3), hold_out=[run(truth, 2)], options=OPTIONS)
    assert sure.verdict == "explained"
    assert [f.effect.id for f in sure.findings] == ["coulomb-friction"]


def test_the_corrected_ship_runs_freely_within_the_noise(found: Diagnosis, tmp_path: Path) -> None:
    found.save(tmp_path)
    corrected = load_ship(tmp_path / "corrected_ship.toml")
    assert corrected.parameter(COULOMB).value == pytest.approx(0.03, rel=0.05)
    table = run({COULOMB: 0.03, INERTIA: 1.25e-3}, 9)
    error = simulate_recording(corrected, table)["shaft_speed_rad_s"] - table["shaft_speed_rad_s"]
    assert float(np.sqrt(np.mean(np.square(error[50:])))) < 0.5  # the noise is 0.3
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["verdict"] == "partly-explained"
    assert report["effects"][0]["id"] == "coulomb-friction"
    assert (tmp_path / "report.html").stat().st_size > 20_000


def test_a_healthy_rig_lacks_nothing() -> None:
    found = diagnose(motor(), run(seed=4), hold_out=[run(seed=5)], options=OPTIONS)
    assert found.verdict == "nothing-missing"
    assert found.findings == []


def test_a_file_that_is_wrong_is_no_healthy_rig() -> None:
    """Half of the inertia: no physics is missing, and the file is not right."""
    tables = [run({INERTIA: 1.6e-3}, seed) for seed in (4, 5, 6)]
    found = diagnose(motor(), *tables[:2], hold_out=tables[2:], options=OPTIONS)
    assert (found.verdict, found.findings) == ("unexplained", [])
    assert found.headline == "The ship file is wrong in inertia engine side."
    assert found.sentence.startswith("Parameters of the ship file are wrong: transmission.inertia")
    (number,) = found.parameters
    assert number.corrected == pytest.approx(1.6e-3, rel=0.02)
    assert all(b.left is None for b in found.balance_verdicts)


@pytest.mark.parametrize("factor", [1.03, 1.08])
def test_a_slightly_wrong_inertia_is_no_physics(factor: float) -> None:
    """The first search absorbs 8 % of the inertia in friction; the file allows half a percent."""
    tables = [run({INERTIA: factor * 1e-3}, seed) for seed in (4, 5, 6)]
    found = diagnose(motor(), *tables[:2], hold_out=tables[2:])
    assert (found.verdict, found.findings) == ("unexplained", [])
    assert found.headline == "The ship file is wrong in inertia engine side."
    (number,) = found.parameters
    assert number.corrected == pytest.approx(factor * 1e-3, rel=0.003)
    quick = diagnose(motor(), *tables[:2], hold_out=tables[2:], options=Options(quick=True))
    assert quick.verdict == ("unexplained" if factor < 1.05 else "partly-explained")


def test_the_corrected_ship_alone_is_reported_where_a_clock_is_skewed(found: Diagnosis) -> None:
    """The speed is 0.4 rows late, which no ship file can hold."""
    alone = "without clock skews and estimated first states, as in shaftline simulate"
    assert not [w for w in found.warnings if w.startswith(alone)]
    tables = [run({COULOMB: 0.03}, seed) for seed in (1, 2)]
    for table in tables:
        rows = np.arange(len(table))
        table["shaft_speed_rad_s"] = np.interp(rows - 0.4, rows, table["shaft_speed_rad_s"])
    late = diagnose(motor(), tables[0], hold_out=tables[1:], options=OPTIONS)
    (said,) = (w for w in late.warnings if w.startswith(alone))
    error = float(said.rpartition(" ")[2])
    simulated = simulate_recording(late.corrected, tables[1])["shaft_speed_rad_s"]
    assert error == pytest.approx(
        float(np.sqrt(np.mean((simulated - tables[1]["shaft_speed_rad_s"]) ** 2))), rel=0.05
    )


def test_a_recording_too_dull_to_decide_is_not_healthy() -> None:
    tables = [run(seed=seed).assign(motor_voltage_V=6.0) for seed in (4, 5)]
    for table in tables:
        true = simulate_recording(motor(), table)["shaft_speed_rad_s"]
        table["shaft_speed_rad_s"] = true + 0.3 * np.random.default_rng(1).standard_normal(
            len(true)
        )
    found = diagnose(motor(), tables[0], hold_out=tables[1:], options=OPTIONS)
    assert found.verdict == "unexplained"
    assert found.undecidable
    assert found.sentence.startswith("Whether physics is missing cannot be decided, because ")


def test_a_model_whose_parameters_alone_diverge_leaves_the_first_diagnosis(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def diverge(*_: object) -> Diagnosis:
        raise RunawayError("motor: the simulated shaft_speed_rad_s is not finite")

    truth = {COULOMB: 0.03, INERTIA: 1.25e-3}
    data = motor(), run(truth, 1)
    first = diagnose(*data, hold_out=[run(truth, 2)], options=replace(OPTIONS, quick=True))
    monkeypatch.setattr("shaftline.mismatch.structure.diagnose._update_diagnosis", diverge)
    found = diagnose(*data, hold_out=[run(truth, 2)], options=OPTIONS)
    assert found.warnings[-1] == NO_BASE
    assert found.to_dict()["effects"] == first.to_dict()["effects"]


def test_no_more_is_reported_than_was_asked_for_and_no_parameter_moves_without_a_tolerance() -> (
    None
):
    truth = {COULOMB: 0.03, "prime_mover.open_circuit_fraction": 1.0}
    options = Options(exclude=OTHERS, most_effects=1, tolerance=0.0)
    found = diagnose(motor(), run(truth, 1), hold_out=[run(truth, 2)], options=options)
    assert len(found.findings) <= 1
    assert found.parameters == []


def test_the_second_search_mends_what_a_biased_inertia_has_made_of_friction() -> None:
    """With the inertia within its tolerance the first search finds the friction, 40 % too small."""
    wide = motor().with_values({"tolerances.inertia": 0.3})
    truth = {COULOMB: 0.03, INERTIA: 1.25e-3}
    sizes = []
    for options in (replace(OPTIONS, quick=True), OPTIONS):
        found = diagnose(
            wide, run(truth, 1), run(truth, 3), hold_out=[run(truth, 2)], options=options
        )
        (finding,) = found.findings
        sizes.append(finding.estimates[0].value)
    assert sizes[0] < 0.022
    assert sizes[1] == pytest.approx(0.03, rel=0.02)


def test_where_the_first_search_leaves_noise_its_result_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def quick_pass(self: StructureSearch) -> list[Model]:
        asked.append(self)
        return []

    monkeypatch.setattr(StructureSearch, "quick_pass", quick_pass)
    diagnose(motor(), run({COULOMB: 0.03}, 1), hold_out=[run({COULOMB: 0.03}, 2)], options=OPTIONS)
    assert asked == []
