"""The reversal's programme, its torque, the scores and the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from reproductions.towing_tank import observers as study
from shaftline.observers import get_observer
from shaftline.plant import State, load_ship, simulate
from shaftline.plant.ship_files import write_ship
from shaftline.plant.simulation import Schedule
from tests.observers.rig import PITCH, RIG


@pytest.fixture(scope="module")
def run() -> study.Run:
    return study.calm_test(RIG)


def test_the_carriage_goes_to_and_fro() -> None:
    times = np.array(
        [0.0, 0.5, 1.0, 8.9, 9.5, 10.0, 11.0, 18.9, 20.0, 21.0, 30.0, 31.0, 58.9, 60.0]
    )
    values = [0.0, 0.5, 1.0, 1.0, 0.5, 0.0, -1.0, -1.0, 0.0, 1.0, 0.0, -1.0, -1.0, 0.0]
    assert study.programme(times) == pytest.approx(values)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_torque_keeps_the_thrust(sign: float) -> None:
    torque = study.steady_torque(RIG, 80.0 * sign, sign)
    still = simulate(RIG, Schedule(torque, PITCH, inflow=sign), 6.0, initial=State(PITCH, 0.0, 0.0))
    assert still["thrust"][-1] == pytest.approx(80.0 * sign, rel=1e-3)


def test_scores_are_those_of_the_estimates(run: study.Run) -> None:
    against = run.against
    assert 0.01 < against.mean() < 0.1
    truth = study.scores(run, get_observer("oracle"), run.readings)
    assert truth["rms valid"] == truth["rms in zone 1"] == 0.0
    assert truth["valid %"] == truth["zone 1 called valid %"] == 100.0
    nothing = study.scores(run, get_observer("none"), run.readings)
    assert np.isnan(nothing["rms valid"])
    inflow = run.samples["advance_velocity"]
    assert nothing["rms outside zone 1"] == pytest.approx(np.sqrt(np.mean(inflow[~against] ** 2)))


def test_noise_is_of_its_size(run: study.Run) -> None:
    noise = study.Noise(0.1, 0.2, 3.0)
    away = run.noisy(noise, 1) - run.readings
    assert away.std(axis=0) == pytest.approx([0.1, 0.2, 0.0, 3.0, 0.0], rel=0.02)
    assert np.array_equal(run.noisy(noise, 1), run.noisy(noise, 1))
    assert not np.array_equal(run.noisy(noise, 1), run.noisy(noise, 2))


def test_what_is_wanted_holds_for_who_knows_the_acceleration(run: study.Run) -> None:
    shaft = {"shaft": get_observer("shaft-acceleration"), "power": get_observer("power-balance")}
    clean = study.table_of(run, shaft, None, 3).set_index("observer")
    noisy = study.table_of(run, shaft, study.Noise(), 2).set_index("observer")
    for table, zone in ((clean, 0.0), (noisy, 30.0)):
        assert table.loc["shaft", "rms valid"] < study.WANTED_M_S < table.loc["power", "rms valid"]
        assert table.loc["shaft", "zone 1 called valid %"] <= zone
        assert table.loc["shaft", "valid %"] > 85.0
    words = study.limits_met(clean.reset_index(), noisy.reset_index())
    assert "Without noise: 1 of 2 stay below 0.1 m/s where valid (`shaft`); 1 in all" in words


def test_a_crash_stop_is_seen_until_the_shaft_reverses() -> None:
    run = study.crash_stop()
    found = study.scores(run, get_observer("immersion-invariance"), run.readings)
    assert found["zone 1 called valid %"] == 0.0
    assert found["rms outside zone 1"] < 0.05 < 1.0 < found["rms in zone 1"]
    assert found["valid %"] == pytest.approx(100.0 * (1.0 - run.against.mean()), abs=1.0)
    when = study.followed_against_inflow(run)
    assert when["reversed"] < when["lost"] - 10.0 < run.samples["time"][-1]
    assert when["follows"] < 0.1
    assert load_ship("ddg-51-surrogate").propeller.model == "b-series"  # as it is packaged


def test_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rig.toml"
    write_ship(RIG, file)
    study.main(["--out", str(tmp_path), "--ship", str(file), "--seeds", "1"])
    assert "page: " in capsys.readouterr().out
    page = (tmp_path / "four-quadrant-observers.md").read_text(encoding="utf-8")
    assert "{" not in page
    assert (tmp_path / "figures" / "four-quadrant-observers.png").stat().st_size > 10_000
    table = pd.read_csv(tmp_path / "four-quadrant-observers.csv")
    assert set(table["test"]) == {"rig", "rig with noise", "crash stop"}
    with pytest.raises(SystemExit):
        study.main(["--seeds", "0"])
