"""Where effects act on board, and what to check next."""

from __future__ import annotations

import pytest

from shaftline.mismatch import catalogue
from shaftline.mismatch.report.advice import ADVICE, advice_of
from shaftline.plant import load_ship

from ..diagnoses import entry


@pytest.mark.parametrize(
    ("label", "where", "check"),
    [
        ("hull-fouling (hull)", "hull", "Inspect the hull"),
        ("resistance-episode (hull)", "hull, for a time", "deck log"),
        ("current (hull)", "current", "No work on the ship"),
        ("current (hull, any-way)", "current", "No work on the ship"),
        ("wind (hull)", "wind or sea", "No work on the ship"),
        ("rudder-resistance (hull)", "hull and rudder in turns", "rudder angle indicator"),
        ("coulomb-friction (propeller)", "shaft line behind the torque meter", "bearings"),
        ("coulomb-friction (engine)", "engine side of the shaft line", "gearbox"),
        ("engine-derating (engine)", "engine", "fuel quality"),
        ("torque-sensor-bias (sensor)", "shaft torque meter", "with the shaft at rest"),
        ("speed-log-lag (sensor)", "speed log", "filter setting"),
        ("speed-sensor-gain (sensor)", "shaft speed sensor", "tachometer"),
        ("pitch-sensor-offset (sensor)", "pitch sensor", "mark on the hub"),
        ("command-dead-zone (motor)", "electric drive", "supply voltage"),
    ],
)
def test_an_effect_has_its_location_and_its_check(label: str, where: str, check: str) -> None:
    advice = advice_of(entry(label))
    assert advice.where == where
    assert check in advice.next_step


def test_every_effect_of_any_balance_has_advice() -> None:
    assert all(advice_of(effect).next_step.endswith(".") for effect in catalogue())
    balances = {effect.balance for effect in catalogue()}
    for name in ("frigate-turning", "rov-thruster"):
        balances |= {*load_ship(name).balances}
    whole = {advice.balance for advice in ADVICE if not advice.keys}
    assert balances - whole == set()


def test_no_entry_is_hidden_by_an_earlier_one() -> None:
    for place, advice in enumerate(ADVICE):
        for earlier in ADVICE[:place]:
            if earlier.balance == advice.balance:
                assert earlier.keys
                assert not any(key.startswith(earlier.keys) for key in advice.keys)
