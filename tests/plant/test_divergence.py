"""A simulation that diverges is refused wherever it runs, and leaves no file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tomli_w
from typer.testing import CliRunner

from shaftline.cli.main import app
from shaftline.plant import Schedule, equilibrium, load_ship, simulate
from shaftline.plant.replay import simulate_recording
from shaftline.plant.ship import Ship
from shaftline.plant.signals import SAMPLE, SIGNALS
from shaftline.plant.stepping import refuse_divergence
from shaftline.plant.voyage import Voyage

SHIP = load_ship("frigate")


def _runaway(ship: Ship) -> Ship:
    """A ship with a term that leaves its rest as soon as the speed changes, and never returns.

    It grows slowly enough to be loaded, and has a rest, without which no start would be found.
    """
    term = {
        "id": "runaway",
        "acts_on": "resistance",
        "expression": "u",
        "state": "u",
        "rate": "ship_speed + u * 15",
    }
    return ship.with_values({"term": [term]})


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda signal: signal.name)
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -1e114])
def test_every_signal_is_looked_at(signal: object, value: float) -> None:
    samples = np.zeros(5, SAMPLE)
    samples["time"] = 0.1 * np.arange(5)
    refuse_divergence(SHIP, samples)
    name = signal.name  # type: ignore[attr-defined]
    samples[name][3] = value
    unbounded = signal.source == "demand" or math.isinf(signal.high)  # type: ignore[attr-defined]
    if unbounded and math.isfinite(value):
        return refuse_divergence(SHIP, samples)
    with pytest.raises(ValueError, match=f"{signal.column} = ") as caught:  # type: ignore[attr-defined]
        refuse_divergence(SHIP, samples)
    assert name == "time" or " at 0.3 s" in str(caught.value)
    return None


def test_a_simulation_is_refused() -> None:
    ship = _runaway(SHIP)
    start = equilibrium(SHIP, 20.0, 1.2).state
    with pytest.raises(ValueError, match=r"diverges: .* time step of 0\.05 s"):
        simulate(ship, Schedule(20.0, 1.2), 60.0, initial=start)


def test_a_recordings_simulation_is_refused() -> None:
    start = equilibrium(SHIP, 20.0, 1.2).state
    time = 0.1 * np.arange(600)
    rack = np.where(time < 5.0, 20.0, 15.0)
    table = pd.DataFrame(
        {
            "time_s": time,
            "fuel_rack_mm": rack,
            "pitch_ratio_command": 1.2,
            "pitch_ratio": 1.2,
            "shaft_speed_rad_s": start.shaft_speed,
            "ship_speed_m_s": start.ship_speed,
        }
    )
    simulate_recording(SHIP, table)
    with pytest.raises(ValueError, match="diverges"):
        simulate_recording(_runaway(SHIP), table)


def test_a_voyage_is_refused() -> None:
    start = equilibrium(SHIP, 20.0, 1.2).state
    voyage = Voyage(_runaway(SHIP), start, 20.0)
    with pytest.raises(ValueError, match="diverges"):
        voyage.run(20.0, 1.2, steps=1200)


def test_the_command_leaves_no_file(tmp_path: Path) -> None:
    ship = tmp_path / "ship.toml"
    ship.write_text(tomli_w.dumps(_runaway(SHIP).model_dump(exclude_unset=True, exclude_none=True)))
    line = [
        "simulate",
        "--ship",
        str(ship),
        "--case",
        "rack_step",
        "--out",
        str(tmp_path / "o.csv"),
    ]
    result = CliRunner().invoke(app, line)
    assert result.exit_code == 2, result.output
    assert "diverges" in result.output
    assert [file.name for file in tmp_path.iterdir()] == ["ship.toml"]
