"""An open-water table of one's own: its entries met, its slopes, its edges, and back from KQ to J."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.plant import Ship, ShipError, equilibrium, linearise, load_ship, write_ship
from shaftline.plant.open_water import invert_table, table_curve
from shaftline.plant.propeller import (
    advance_ratio_of,
    propeller_load,
    thrust_coefficient,
    torque_coefficient,
    torque_coefficient_slope,
)

STEP = 1e-30
J = [0.0, 0.1, 0.3, 0.6, 1.0]
KT = [0.40, 0.37, 0.29, 0.15, -0.05]
KQ = [0.050, 0.047, 0.039, 0.024, 0.002]
ONE = {"advance_ratio": J, "thrust_coefficient": KT, "torque_coefficient": KQ}


def with_table(ship: Ship, table: dict[str, Any], **keys: float) -> Ship:
    tree = ship.model_dump(exclude_unset=True)
    tree["propeller"] = tree["propeller"] | {"model": "table", "open_water": table} | keys
    return Ship.model_validate(tree)


@pytest.fixture(scope="module")
def one(frigate: Ship) -> Any:
    """Record of a fixed-pitch propeller with a table."""
    return with_table(frigate, ONE, pitch_ratio_min=1.0, pitch_ratio_max=1.0).record()


@pytest.fixture(scope="module")
def tabled(frigate: Ship) -> Ship:
    """The frigate with its own curves as a table."""
    plant = frigate.record()
    ratios, pitches = [0.05 * k - 0.1 for k in range(32)], [0.6, 0.8, 1.0, 1.2, 1.4]
    return with_table(
        frigate,
        {
            "advance_ratio": ratios,
            "pitch_ratio": pitches,
            "thrust_coefficient": [
                [thrust_coefficient(plant, j, p) for j in ratios] for p in pitches
            ],
            "torque_coefficient": [
                [torque_coefficient(plant, j, p) for j in ratios] for p in pitches
            ],
        },
    )


def test_every_entry_is_met(one: Any, tabled: Ship, frigate: Ship) -> None:
    for j, kt, kq in zip(J, KT, KQ, strict=True):
        for pitch in (0.5, 1.0, 1.4):  # of no effect with one curve
            assert thrust_coefficient(one, j, pitch) == pytest.approx(kt, abs=1e-15)
            assert torque_coefficient(one, j, pitch) == pytest.approx(kq, abs=1e-15)
    several, own = tabled.record(), frigate.record()
    for pitch in (0.6, 1.0, 1.4):
        for j in (-0.1, 0.0, 0.55, 1.45):
            expected = torque_coefficient(own, j, pitch)
            assert torque_coefficient(several, j, pitch) == pytest.approx(expected, abs=1e-12)


def test_between_entries_it_falls_where_they_fall(one: Any) -> None:
    found = [torque_coefficient(one, j, 1.0) for j in np.linspace(0.0, 1.0, 201)]
    assert (np.diff(found) < 0.0).all()


def test_a_smooth_curve_is_followed(tabled: Ship, frigate: Ship) -> None:
    """Half-way between entries of 0.05 in J and 0.2 in P/D: KT to 6e-4, KQ to 1e-4."""
    several, own = tabled.record(), frigate.record()
    for j in np.arange(0.025, 1.2, 0.05):
        for pitch in (0.7, 0.9, 1.1, 1.3):
            for curve, most in ((thrust_coefficient, 6e-4), (torque_coefficient, 1e-4)):
                assert curve(several, j, pitch) == pytest.approx(curve(own, j, pitch), abs=most)


@pytest.mark.parametrize("pitch", [0.6, 0.73, 1.0, 1.31, 1.4])
@pytest.mark.parametrize("j", [-0.1, 0.0, 0.12, 0.55, 1.2])
def test_slopes_are_those_of_the_curve(tabled: Ship, j: float, pitch: float) -> None:
    plant = tabled.record()
    slope = complex(torque_coefficient(plant, j + STEP * 1j, complex(pitch))).imag / STEP
    assert torque_coefficient_slope(plant, j, pitch) == pytest.approx(slope, rel=1e-12)
    h = 1e-6
    if j > -0.1 and 0.6 < pitch < 1.4:
        by_j = (
            torque_coefficient(plant, j + h, pitch) - torque_coefficient(plant, j - h, pitch)
        ) / 2
        assert slope == pytest.approx(by_j / h, abs=1e-6)  # without kinks at the entries
        by_p = (
            torque_coefficient(plant, j, pitch + h) - torque_coefficient(plant, j, pitch - h)
        ) / 2
        exact = complex(torque_coefficient(plant, complex(j), pitch + STEP * 1j)).imag / STEP
        assert exact == pytest.approx(by_p / h, abs=1e-6)


def test_outside_the_table_it_is_held_at_its_edges(one: Any, tabled: Ship) -> None:
    assert table_curve(one, one["table_kt"], -0.4, 1.0)[0] == KT[0]
    assert table_curve(one, one["table_kt"], 1.7, 1.0)[0] == KT[-1]
    several = tabled.record()
    assert torque_coefficient(several, 0.5, 1.6) == torque_coefficient(several, 0.5, 1.4)
    speed, diameter = 9.0, float(one["diameter"])
    beyond = 1.3 * diameter * speed / (2.0 * math.pi)
    found = propeller_load(one, beyond, speed, 1.0, 4.0, 0.0)
    n = speed / (2.0 * math.pi)
    assert found.thrust == pytest.approx(1025.0 * n**2 * diameter**4 * KT[-1], rel=1e-12)
    assert found.torque == pytest.approx(1025.0 * n**2 * diameter**5 * KQ[-1], rel=1e-12)


@pytest.mark.parametrize("j", [1e-6, 0.05, 0.1, 0.44, 0.99])
def test_the_torque_coefficient_is_inverted_exactly(one: Any, tabled: Ship, j: float) -> None:
    for guess in (0.0, 0.7, math.nan):
        found, valid = advance_ratio_of(one, torque_coefficient(one, j, 1.0), 1.0, guess)
        assert valid
        assert found == pytest.approx(j, abs=1e-12)
    plant = tabled.record()
    for pitch in (0.8, 0.93, 1.4):
        found, valid = advance_ratio_of(plant, torque_coefficient(plant, j, pitch), pitch, 0.3)
        assert valid
        assert found == pytest.approx(j, abs=1e-10)


def test_outside_the_falling_branch_nothing_is_vouched_for(one: Any, frigate: Ship) -> None:
    assert invert_table(one, 0.051, 1.0, 0.4) == (0.0, False)
    assert invert_table(one, 0.050, 1.0, 0.4) == (0.0, True)
    assert invert_table(one, 0.001, 1.0, 0.4) == (1.0, False)
    assert invert_table(one, math.nan, 1.0, 0.4) == (0.4, False)
    # a branch that begins at the first J and ends where the curve rises again
    humped = ONE | {
        "advance_ratio": [0.2, 0.3, 0.5, 0.8, 1.1],
        "torque_coefficient": [5, 4, 2, 3, 1],
    }
    table = {k: [0.01 * x for x in v] if k[0] == "to" else v for k, v in humped.items()}
    table["torque_coefficient"] = [0.05, 0.04, 0.02, 0.03, 0.01]
    plant = with_table(frigate, table, pitch_ratio_min=1.0, pitch_ratio_max=1.0).record()
    assert invert_table(plant, 0.06, 1.0, 0.4) == (0.2, False)
    assert invert_table(plant, 0.019, 1.0, 0.4) == (0.5, False)
    found, valid = invert_table(plant, 0.025, 1.0, 0.9)
    assert valid
    assert 0.3 < found < 0.5


def test_a_ship_sails_by_its_table(tabled: Ship, frigate: Ship) -> None:
    for pitch in (0.9, 1.3):
        ours, theirs = (equilibrium(ship, 22.0, pitch) for ship in (tabled, frigate))
        assert ours.state.ship_speed == pytest.approx(theirs.state.ship_speed, rel=2e-3)
        a, b = (np.asarray(linearise(s, e).A) for s, e in ((tabled, ours), (frigate, theirs)))
        np.testing.assert_allclose(a, b, rtol=0.05, atol=2e-3)


def test_a_table_survives_its_file(tabled: Ship, frigate: Ship, tmp_path: Path) -> None:
    for ship in (tabled, with_table(frigate, ONE, pitch_ratio_min=1.0, pitch_ratio_max=1.0)):
        assert load_ship(write_ship(ship, tmp_path / "t.toml")) == ship


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"advance_ratio": [0.0, 0.1, 0.1, 0.6, 1.0]},
            r"open_water: the values of advance_ratio must rise",
        ),
        (
            {"thrust_coefficient": KT[:4]},
            r"thrust_coefficient must have one entry for each of the 5 values.* it has 4",
        ),
        ({"pitch_ratio": [0.8, 1.0]}, r"in one list for each of 2 pitch_ratio; it has 5"),
        ({"advance_ratio": [0.0]}, r"open_water\.advance_ratio.*at least 2"),
        ({"torque_coefficient": "0.05"}, r"open_water\.torque_coefficient"),
        ({"colour": 1.0}, r"open_water\.colour is not a known key"),
    ],
)
def test_a_bad_table_is_named(tmp_path: Path, frigate: Ship, change: Any, words: str) -> None:
    fixed = frigate.with_values({"propeller.pitch_ratio_min": 1.4})
    with pytest.raises(ShipError, match=words):
        fixed.with_values({"propeller.model": "table", "propeller.open_water": ONE | change})


def test_a_table_belongs_to_its_model_and_covers_the_ships_pitch(frigate: Ship) -> None:
    with pytest.raises(ShipError, match=r"propeller\.open_water is missing; .*\.model = 'table'"):
        frigate.with_values({"propeller.model": "table"})
    with pytest.raises(ShipError, match=r"open_water has no effect with propeller\.model = 'b-ser"):
        frigate.with_values({"propeller.open_water": ONE})
    with pytest.raises(ShipError, match=r"a variable pitch needs open_water\.pitch_ratio"):
        frigate.with_values({"propeller.model": "table", "propeller.open_water": ONE})
    two = {
        "pitch_ratio": [0.7, 1.4],
        "thrust_coefficient": [KT, KT],
        "torque_coefficient": [KQ, KQ],
    }
    with pytest.raises(ShipError, match=r"must lie within open_water\.pitch_ratio, 0\.7 to 1\.4"):
        frigate.with_values({"propeller.model": "table", "propeller.open_water": ONE | two})


def test_a_published_table_is_read(frigate: Ship) -> None:
    """KVLCC2: every second entry left out is met to the table's own digits."""
    file = Path(os.environ.get("SHAFTLINE_DATA", "")) / "recordings/kvlcc2_hsva/open_water.csv"
    if "SHAFTLINE_DATA" not in os.environ or not file.is_file():
        pytest.skip("needs recordings/kvlcc2_hsva in the folder SHAFTLINE_DATA")
    printed = pd.read_csv(file)
    half = printed.iloc[::2]
    table = {
        "advance_ratio": half["J"].tolist(),
        "thrust_coefficient": half["Kt"].tolist(),
        "torque_coefficient": (0.1 * half["10Kq"]).tolist(),
    }
    plant = with_table(frigate, table, pitch_ratio_min=0.721, pitch_ratio_max=0.721).record()
    for row in printed.itertuples():
        assert thrust_coefficient(plant, row.J, 0.721) == pytest.approx(row.Kt, abs=8e-4)
        kq = torque_coefficient(plant, row.J, 0.721)
        assert 10.0 * kq == pytest.approx(printed.loc[row.Index, "10Kq"], abs=8e-4)


LINE = [0.1 * k for k in range(11)]


@pytest.mark.parametrize("pitch", [0.4, 0.7, 1.0, 1.4])
@pytest.mark.parametrize("step", [0.05, 0.1, 0.2])
def test_curves_of_real_propellers_are_no_damage(frigate: Ship, pitch: float, step: float) -> None:
    plant = frigate.record()
    j = [step * k for k in range(-2, min(30, round(1.6 / step)))]
    rng = np.random.default_rng(0)
    table: dict[str, Any] = {"advance_ratio": j}
    for name, curve in (("thrust", thrust_coefficient), ("torque", torque_coefficient)):
        values = np.array([curve(plant, x, pitch).real for x in j])
        scatter = 0.01 * np.abs(values).max() * rng.standard_normal(len(j))  # of a tank's readings
        table[f"{name}_coefficient"] = (values + scatter).tolist()
    with_table(frigate, table, pitch_ratio_min=1.0, pitch_ratio_max=1.0)


@pytest.mark.parametrize("row", range(11))
@pytest.mark.parametrize("damage", [0.1, -1.0, 3.5])
def test_a_damaged_entry_is_named(frigate: Ship, row: int, damage: float) -> None:
    plant = frigate.record()
    kt = [thrust_coefficient(plant, x, 1.2).real for x in LINE]
    kq = [torque_coefficient(plant, x, 1.2).real for x in LINE]
    assert abs(kt[row]) > 0.1
    kt[row] = round(kt[row] * damage, 4)
    with pytest.raises(
        ValueError,
        match=rf"thrust_coefficient at advance_ratio {LINE[row]:g} is {kt[row]:g}, but its neigh",
    ):
        with_table(
            frigate,
            {"advance_ratio": LINE, "thrust_coefficient": kt, "torque_coefficient": kq},
            pitch_ratio_min=1.0,
            pitch_ratio_max=1.0,
        )
