"""The report's first page: headline, large numbers, where, what next, and how sure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch import Diagnosis
from shaftline.mismatch.identification.parameters import BiasedParameter, ParameterChange
from shaftline.mismatch.judge.verdict import BalanceVerdict, Detectable
from shaftline.mismatch.report.data import diagnosis_as_dict
from shaftline.mismatch.report.first_page import HEALTHY_FUEL, first_page
from shaftline.mismatch.report.service import ENGINE_POWER, EQUAL_POWER
from shaftline.mismatch.search.catalogue import SizedEffect
from shaftline.mismatch.search.fitting import Colour
from shaftline.plant import Ship, load_ship

from ..diagnoses import ROWS, candidate, diagnosis_of, entry
from .test_service import finding, fouled, sea_trial


def derated(**changes: Any) -> Diagnosis:
    return sea_trial(
        "prime_mover.derating_fraction", "engine-derating (engine)", 0.08, 0.005, **changes
    )


def misread(**changes: Any) -> Diagnosis:
    return sea_trial("sensors.torque_gain", "torque-sensor-gain (sensor)", 1.05, 0.005, **changes)


def test_a_fouled_hull_costs_speed_power_and_fuel() -> None:
    page = first_page(fouled())
    power, equal = (page.service.quantities[name] for name in (ENGINE_POWER, EQUAL_POWER))
    loss = -equal.percent(equal.change)
    assert page.headline == (
        f"Hull fouling: {loss:.1f} % slower, {power.change:.0f} kW more at 15.6 kn."
    )
    assert [tile.label for tile in page.tiles] == ["Speed loss", "Extra power", "Extra fuel"]
    speed, extra, fuel = page.tiles
    assert speed.value == f"{loss:.1f} %"
    assert equal.ci95 is not None
    low, high = (-equal.percent(end) for end in reversed(equal.ci95))
    assert low < loss < high
    assert speed.interval == f"95 % interval {low:.1f} to {high:.1f} %"
    assert extra.value == f"{power.change:.0f} kW"
    assert extra.detail.startswith(f"engine power {power.after:.0f} in place of {power.before:.0f}")
    assert fuel.value.endswith("t/d")
    assert page.where == ["hull"]
    assert "Inspect the hull" in page.next_steps[0]
    assert page.doubts == ["Hull fouling: no other effect fits this recording as well."]
    assert "In brackets, 95 % intervals: each estimated parameter" in page.method


def test_a_cleaner_ship_gains_speed() -> None:
    page = first_page(sea_trial("hull.fouling_fraction", "hull-fouling (hull)", -0.05, 0.005))
    assert [tile.label for tile in page.tiles] == ["Speed gain", "Less power", "Less fuel"]
    assert " % faster, " in page.headline
    assert " kW less at 15.6 kn." in page.headline
    assert not any("−" in tile.value + tile.interval for tile in page.tiles)


def test_an_engine_costs_speed_at_equal_rack_and_no_power() -> None:
    page = first_page(derated())
    assert page.headline.startswith("Engine derating: ")
    assert page.headline.endswith(" % slower at equal fuel rack.")
    assert [tile.label for tile in page.tiles] == ["Speed loss", "Extra fuel rack", "Extra power"]
    assert page.tiles[2].value == "none"
    assert HEALTHY_FUEL in page.doubts
    assert HEALTHY_FUEL not in first_page(fouled()).doubts


@pytest.mark.parametrize(
    ("source", "advice"),
    [("tolerance", "(shaftline diagnose --calibrate)."), ("calibrated", "that has no name here.")],
)
def test_parameters_far_from_the_ship_file_are_a_doubt(source: str, advice: str) -> None:
    far, near = (
        ParameterChange(key, "-", 1.0, 1.2, 0.01, shifts, source, 1.2)
        for key, shifts in (("hull.wake_fraction", -6.2), ("hull.thrust_deduction", 2.9))
    )
    (doubt,) = (d for d in first_page(fouled(parameters=[far, near])).doubts if "less certain" in d)
    assert "also moves hull.wake_fraction (-6.2 tolerances). " in doubt
    assert "thrust_deduction" not in doubt
    assert doubt.endswith(advice)
    assert not any("less certain" in d for d in first_page(fouled(parameters=[near])).doubts)


def test_an_instrument_is_wrong_and_not_the_ship() -> None:
    page = first_page(misread())
    assert page.headline == "An instrument is wrong, not the ship: torque sensor gain."
    assert page.tiles == []
    assert page.lead == (
        "Power, fuel and speed in steady service are those of the ship file. The shaft torque meter has "
        "a torque gain 1.05 (95 % interval 1.04 to 1.06)."
    )
    assert page.where == ["shaft torque meter"]
    assert page.method == page.service.condition
    part = first_page(misread(verdict="partly-explained"))
    assert part.headline == "An instrument is wrong: torque sensor gain; a residual remains."


def test_nothing_missing_states_what_could_hide(frigate: Ship) -> None:
    hidden = [Detectable(SizedEffect(entry("hull-fouling (hull)"), (0.02,)), 0.02, "-")]
    page = first_page(
        replace(
            fouled(findings=[], detectable=hidden), corrected=frigate, verdict="nothing-missing"
        )
    )
    assert page.headline == "No loss found: the ship performs as the ship file says."
    kilowatts = page.service.hidden[0][1]
    assert f"A smaller loss than {kilowatts:.0f} kW by hull fouling" in page.lead
    assert "No work follows" in page.next_steps[0]
    assert {row.change for row in page.rows} == {"none"}


def test_undecided_asks_for_another_recording() -> None:
    limits = ["too short: 60 s", "the rack stands still", "the pitch stands still"]
    page = first_page(diagnosis_of("unexplained", limits=limits, undecidable=True, excited=False))
    assert page.headline.startswith("Cannot be decided")
    assert page.lead == (
        "No numbers of power and fuel: the recording does not decide what is missing."
    )
    assert page.next_steps[0].startswith("Record again before any work")
    assert page.doubts[-1] == "1 more limit of the recording: see the technical part."
    assert page.where == ["not located"]
    assert page.to_dict()["speed_loss_percent"] is None


def test_alternatives_have_their_own_check() -> None:
    diagnosis = fouled()
    rival = candidate("current (hull)", 199.0, 0.3)
    page = first_page(
        replace(diagnosis, findings=[replace(diagnosis.findings[0], rivals=(rival,))])
    )
    assert page.headline.startswith("Hull fouling or an alternative: ")
    assert page.next_steps[1].startswith("If it is current instead: no work on the ship follows")
    assert page.doubts[0] == (
        "Hull fouling is indistinguishable from current in this recording. To distinguish them: "
        f"{diagnosis.findings[0].effect.split_by}."
    )


def test_doubts_name_the_biased_parameter_and_the_residual() -> None:
    biased = BiasedParameter("hull.wake_fraction", 0.05, 0.1, "-", 200.0)
    left = BalanceVerdict("hull", "partly-explained", 0.6, Colour(0, 1, 0.005, 0.02, 14.0))
    page = first_page(fouled(verdict="partly-explained", biased=[biased], balance_verdicts=(left,)))
    assert page.headline.startswith("Partly due to hull fouling: ")
    assert "A biased hull.wake_fraction would explain" in page.doubts[1]
    assert "40 % of the mean square" in page.doubts[2]


def test_a_wrong_ship_file_is_no_loss_of_the_ship_yet(frigate: Ship) -> None:
    key = "hull.resistance_coefficient_N_s2_m2"
    change = ParameterChange(key, "N s2/m2", 3306.2, 3600.0, 20.0, 3.0, "free", 3600.0)
    page = first_page(
        replace(
            fouled(findings=[], parameters=[change]),
            verdict="nothing-missing",
            corrected=frigate.with_values({key: 3600.0}),
        )
    )
    assert page.headline.startswith("Not as the ship file says: ")
    assert page.where == [f"ship file or ship, {key}"]
    assert f"Check {key} of the ship file" in page.next_steps[0]
    ends = page.service.quantities[ENGINE_POWER].ci95
    assert ends is not None
    assert 0.0 < ends[0] < page.service.quantities[ENGINE_POWER].change < ends[1]


def test_a_calibrated_parameter_that_moved_is_a_change_of_the_ship(frigate: Ship) -> None:
    key = "hull.resistance_coefficient_N_s2_m2"
    change = ParameterChange(key, "N s2/m2", 3306.2, 3600.0, 20.0, 14.7, "calibrated", 3600.0)
    changed = replace(
        fouled(findings=[], parameters=[change]),
        verdict="nothing-missing",
        corrected=frigate.with_values({key: 3600.0}),
    )
    assert changed.headline == "Changed since the reference period: resistance coefficient."
    page = first_page(changed)
    assert page.headline.startswith("Changed since the reference period: ")
    assert page.headline.endswith(" kn.")
    assert page.where == [f"ship, {key}"]
    assert page.next_steps == [
        f"Inspect the parts of the ship that {key} describe: they have changed."
    ]


def test_a_calibrated_inertia_is_no_change_of_the_ship() -> None:
    key = "transmission.inertia_engine_side_kg_m2"
    for source, begin in (
        ("calibrated", "Unexplained"),
        ("tolerance", "The ship file is wrong in"),
    ):
        change = ParameterChange(key, "kg m2", 5e4, 7e4, 1e3, 14.7, source, 7e4)
        found = replace(fouled(findings=[], parameters=[change]), verdict="unexplained")
        assert found.headline.startswith(begin)


def test_a_ship_without_a_speed_at_equal_power_has_the_other_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    diagnosis = fouled()
    service = first_page(diagnosis).service
    left = {name: q for name, q in service.quantities.items() if name != EQUAL_POWER}
    monkeypatch.setattr(
        "shaftline.mismatch.report.first_page.service_of",
        lambda *_: replace(service, quantities=left),
    )
    assert [tile.label for tile in first_page(diagnosis).tiles] == ["Extra power", "Extra fuel"]
    assert first_page(diagnosis).to_dict()["speed_loss_percent"] is None


def test_an_unknown_cause_orders_no_work() -> None:
    page = first_page(diagnosis_of("unexplained"))
    assert page.where == ["engine, cause unknown"]
    assert page.next_steps[0].startswith("Order no work on this evidence")


def test_many_effects_are_counted_in_the_headline(frigate: Ship) -> None:
    one = fouled()
    others = [
        finding("wake-speed-dependence (propeller)", "hull.wake_slope_s_m", frigate, 0.001, 1e-4),
        finding(
            "coulomb-friction (propeller)",
            "transmission.coulomb_friction_propeller_side_N_m",
            frigate,
            2000.0,
            100.0,
        ),
    ]
    page = first_page(replace(one, findings=[*one.findings, *others]))
    assert page.headline.startswith("Hull fouling and 2 more: ")
    assert page.where == ["hull", "flow to the propeller", "shaft line behind the torque meter"]


@pytest.mark.parametrize("made", [fouled, derated, misread])
@pytest.mark.parametrize("verdict", ["explained", "partly-explained"])
def test_a_headline_has_at_most_15_words(made: Any, verdict: str) -> None:
    assert len(first_page(made(verdict=verdict)).headline.split()) <= 15


def test_small_ships_have_watts_and_kilograms() -> None:
    rig = load_ship("rov-thruster")
    key = "transmission.coulomb_friction_engine_side_N_m"
    page = first_page(
        diagnosis_of(
            "explained",
            ship=rig,
            corrected=rig.with_values({key: 0.005}),
            measured={},
            drive=np.full(ROWS, 2.0),
            findings=[finding("coulomb-friction (motor)", key, rig, 0.005, 0.0005)],
        )
    )
    assert page.headline.startswith("Coulomb friction: shaft speed ")
    assert page.headline.endswith(" % lower at equal command.")
    assert page.tiles[0].label == "Shaft speed"
    assert page.tiles[0].value.startswith("−")
    (power,) = (row for row in page.rows if row.name == "Drive power")
    assert power.unit == "W"


def test_the_summary_of_the_report_has_the_numbers_of_the_page() -> None:
    diagnosis = fouled()
    page, summary = first_page(diagnosis), diagnosis_as_dict(diagnosis)["summary"]
    assert summary["headline"] == page.headline
    assert summary["service_speed_m_s"] == 8.0
    power = page.service.quantities[ENGINE_POWER]
    assert power.ci95 is not None
    assert summary["quantities"][ENGINE_POWER] == {
        "before": power.before,
        "after": power.after,
        "change": power.change,
        "ci95": list(power.ci95),
    }
    equal = page.service.quantities[EQUAL_POWER]
    assert summary["speed_loss_percent"]["value"] == pytest.approx(
        100.0 * (equal.after / equal.before - 1.0)
    )
    assert summary["speed_loss_percent"]["value"] < 0.0  # the sign of ISO 19030
    low, high = summary["speed_loss_percent"]["ci95"]
    assert low < summary["speed_loss_percent"]["value"] < high < 0.0


@pytest.mark.parametrize(
    ("left", "words"),
    [
        (None, "Not as the ship file says: no loss at 15.6 kn."),
        (
            Colour(0, 1, 0.005, 0.02, 14.0),
            "Not as the ship file says: the loss at 15.6 kn is not determined.",
        ),
    ],
)
def test_a_residual_leaves_the_loss_undetermined(
    frigate: Ship, left: Colour | None, words: str
) -> None:
    inertia = "transmission.inertia_propeller_side_kg_m2"
    far = ParameterChange(inertia, "kg m2", 1.0, 1.2, 0.01, 4.0, "free", 1.2)
    page = first_page(
        replace(
            fouled(findings=[], parameters=[far]),
            corrected=frigate,
            verdict="unexplained",
            balance_verdicts=(BalanceVerdict("hull", "unexplained", 0.0, left),),
        )
    )
    assert page.headline == words
