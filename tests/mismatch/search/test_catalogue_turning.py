"""Entries of the catalogue that only a ship that turns can have: concealed, and found again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import catalogue, diagnose
from shaftline.mismatch.recordings.excitation import course_changes
from shaftline.mismatch.search.catalogue import SizedEffect, applicable_effects
from shaftline.mismatch.search.trial_ship import TrialShip
from shaftline.mismatch.simulate.balances import Balances
from shaftline.mismatch.simulate.joint_replay import JointReplay
from shaftline.plant import Ship, load_ship

from ..turning import quick_tanker, swinging
from .test_catalogue import _named, one_round  # noqa: F401 (a fixture)

TURNING: list[tuple[str, tuple[float, ...]]] = [
    ("rudder-force (yaw)", (2.2,)),
    ("rudder-force (yaw, race)", (0.9,)),
    ("yaw-damping (yaw)", (-0.065,)),
    ("drift-moment (yaw)", (-0.110,)),
    ("sway-damping (sway)", (-0.40,)),
    ("turning-force (sway)", (0.14,)),
    ("current (hull, any-way)", (0.1, -0.06)),
    ("cross-flow-drag (sway)", (600.0,)),
    ("wind-side (sway)", (0.6, 0.8)),
    ("propeller-walk (yaw)", (0.15,)),
    ("propeller-walk (yaw, ahead)", (0.03,)),
]


def concealed(label: str, values: tuple[float, ...]) -> tuple[Ship, pd.DataFrame]:
    """The tanker, and a recording with an entry in it."""
    effect = next(e for e in catalogue() if e.label == label)
    wind = {"side_wind": lambda t: 6.0 * np.sin(t / 37.0) + 2.0}
    extra: dict[str, Any] = wind if label.startswith("wind") else {}
    astern = label == "propeller-walk (yaw)"
    nominal = quick_tanker().with_signals(dict.fromkeys(extra, "m/s"))
    plain = swinging(nominal, extra=extra, astern=astern)
    trial_ship = TrialShip(Balances(JointReplay(nominal, plain)))
    true = trial_ship.corrected((SizedEffect(effect, values),))
    return quick_tanker(), swinging(true, extra=extra, astern=astern)


@pytest.mark.parametrize(("label", "values"), TURNING, ids=[label for label, _ in TURNING])
def test_what_a_turning_ship_meets_is_named(label: str, values: tuple[float, ...]) -> None:
    ship, table = concealed(label, values)
    found = diagnose(ship, table)
    _named(found, label.split(" (")[0], label.split("(")[1].split(",")[0].rstrip(")"))
    if found.findings[0].effect.label == label:
        sizes = [e.value for e in found.findings[0].estimates]
        assert sizes == pytest.approx(values, rel=0.2)
    assert found.explained > 0.7


def test_only_a_ship_that_turns_is_offered_them() -> None:
    labels = {label for label, _ in TURNING}
    everything = {"sway_speed_m_s", "yaw_rate_rad_s", "ship_speed_m_s"}
    for name, offered in (("kvlcc2", labels), ("frigate", set())):
        ship = load_ship(name).with_signals({"side_wind": "m/s"})
        assert labels & {e.label for e in applicable_effects(ship, everything)} == offered


def test_a_current_from_ahead_for_ever_is_not_offered_where_the_recording_turns() -> None:
    columns = {"ship_speed_m_s"}
    for name, turns, offered in (
        ("frigate", False, True),
        ("frigate", True, False),
        ("kvlcc2", True, True),
    ):
        found = {e.id for e in applicable_effects(load_ship(name), columns, turning=turns)}
        assert ("current" in found) == offered


def test_a_recording_turns_by_its_heading_or_its_rate() -> None:
    time = np.arange(0.0, 60.0, 0.5)
    straight = pd.DataFrame({"time_s": time, "heading_rad": 0.4 * np.sin(time)})
    assert not course_changes([straight])
    assert course_changes(
        [straight, straight + {"time_s": 0.0, "heading_rad": 3.0}]
    )  # another course
    assert not course_changes([straight, straight + {"time_s": 0.0, "heading_rad": 2.0 * np.pi}])
    assert course_changes([straight.assign(heading_rad=0.02 * time)])
    rates = pd.DataFrame({"time_s": time, "yaw_rate": 0.02})
    assert course_changes([rates])
    assert not course_changes([rates.assign(yaw_rate=0.005)])
    assert not course_changes([rates[["time_s"]]])
