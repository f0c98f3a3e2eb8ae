"""``shaftline manoeuvre``: table, files, figures, and what is refused."""

from __future__ import annotations

import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.patches import Polygon

from shaftline.display.manoeuvres import OUTLINE, outline, trial_figures
from shaftline.plant import approach, load_ship, turning_circle
from shaftline.plant.manoeuvres import Trials, trials

from .conftest import Command
from .test_bad_input import nothing_written, refused

TRACKS = [
    *(f"turning-circle-{side}" for side in ("port", "starboard")),
    *(f"zig-zag-{a}-{a}-{side}" for a in (10, 20) for side in ("port", "starboard")),
]


@pytest.fixture(scope="module")
def sailed() -> Trials:
    ship = load_ship("ddg-51-surrogate")
    return trials(ship, approach(ship, 11.0))


def test_help_teaches(shaftline: Command) -> None:
    result = shaftline("manoeuvre", "--help")
    assert result.exit_code == 0
    for word in ("MSC.137(76)", "--scale", "zig-zag", "spiral", "[manoeuvring]", "m/s"):
        assert word in result.output


def test_sails_the_standard_set(shaftline: Command, tmp_path: Path) -> None:
    result = shaftline(
        "manoeuvre", "--ship", "kvlcc2", "--speed", 1.18, "--scale", 45.7, "--out", tmp_path
    )
    assert result.exit_code == 0, result.output
    for word in (
        "tactical diameter",
        "second overshoot, 10/10",
        "40.00",
        "yes",
        "directionally unstable",
    ):
        assert word in result.output
    files = {file.name for file in tmp_path.iterdir()}
    assert files == {
        *(f"{name}.csv" for name in (*TRACKS, "spiral", "criteria")),
        *(f"{name}.png" for name in ("turning-circles", "zig-zags", "spiral")),
        "manoeuvres.json",
    }
    for picture in tmp_path.glob("*.png"):
        assert picture.stat().st_size > 20_000
    numbers = json.loads((tmp_path / "manoeuvres.json").read_text())
    ship = load_ship("kvlcc2")
    turn = turning_circle(ship, approach(ship, 1.18), math.radians(35.0))
    found = numbers["turning_circles"]["starboard"]
    assert found["advance"] == turn.advance
    assert found["advance_m"] == 7.0 * turn.advance
    assert (numbers["ship"], numbers["scale"], numbers["not_sailed"]) == ("kvlcc2", 45.7, {})
    row = next(r for r in numbers["criteria"] if r["criterion"] == "advance")
    assert (row["starboard"], row["limit"], row["met"]) == (turn.advance, 4.5, "yes")
    assert len(numbers["zig_zags"]["10/10 port"]["overshoots_deg"]) == 4
    track = pd.read_csv(tmp_path / "turning-circle-port.csv")
    assert track["heading_rad"].iloc[-1] == pytest.approx(-3.0 * math.pi, abs=0.1)
    assert track["cross_track_m"].min() < -20.0
    assert track["time_s"].diff().iloc[1:].to_numpy() == pytest.approx(0.05, abs=2e-3)


def test_numbers_go_where_they_are_asked_for(shaftline: Command, tmp_path: Path) -> None:
    out, numbers = tmp_path / "out", tmp_path / "n.json"
    ship = tmp_path / "narrow.toml"
    text = (Path(__file__).parents[2] / "plant/ships/ddg-51-surrogate.toml").read_text("utf-8")
    ship.write_text(text.replace("0.52359878", "0.3"), "utf-8")
    result = shaftline("manoeuvre", "--ship", ship, "--speed", 11, "--out", out, "--json", numbers)
    assert result.exit_code == 0, result.output
    assert not (out / "manoeuvres.json").exists()
    found = json.loads(numbers.read_text())
    assert set(found["not_sailed"]) == {"20/20 zig-zag to port", "20/20 zig-zag to starboard"}
    row = next(r for r in found["criteria"] if r["criterion"] == "first overshoot, 20/20")
    assert (row["starboard"], row["met"]) == (None, "not completed")
    assert "Not simulated, 20/20 zig-zag to port" in result.output
    assert not list(out.glob("zig-zag-20*"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--ship", "frigate", "--speed", 8), ("cannot be steered", "manoeuvring.length_m")),
        (("--ship", "kvlcc2", "--speed", 9), ("speed of 9", "unit m/s", "<= 2.386")),
        (("--ship", "kvlcc2", "--speed", 1, "--scale", 0), ("--scale 0", "allowed: > 0")),
        (("--ship", "tanker", "--speed", 1), ("unknown ship 'tanker'", "kvlcc2")),
    ],
)
def test_what_cannot_be_sailed_is_refused(
    shaftline: Command, tmp_path: Path, arguments: tuple[object, ...], words: tuple[str, ...]
) -> None:
    refused(shaftline("manoeuvre", *arguments, "--out", tmp_path / "out"), *words)
    nothing_written(tmp_path)


def test_a_file_is_no_folder(shaftline: Command, tmp_path: Path) -> None:
    (tmp_path / "f").write_text("")
    result = shaftline("manoeuvre", "--ship", "kvlcc2", "--speed", 1, "--out", tmp_path / "f")
    refused(result, "give a folder")


def test_a_ship_is_drawn_with_her_bow_ahead() -> None:
    north, east = outline(2.0, 1.0, 0.0), outline(2.0, 1.0, 0.5 * math.pi)
    assert north[np.argmax(north[:, 1])] == pytest.approx((1.0, 2.5))
    assert east[np.argmax(east[:, 0])] == pytest.approx((1.5, 2.0))
    assert np.ptp(OUTLINE[:, 0]) == 1.0


def test_figures_hold_what_was_sailed(sailed: Trials) -> None:
    found = trial_figures(sailed)
    assert set(found) == {"turning-circles", "zig-zags", "spiral"}
    map_, speeds, rates = found["turning-circles"].axes
    starboard = np.asarray(map_.lines[0].get_xydata())
    track = sailed.turns["starboard"].track
    length = sailed.ship.manoeuvring.length_m
    np.testing.assert_allclose(starboard[:, 0], track["cross_track_m"] / length)
    np.testing.assert_allclose(starboard[:, 1], track["position_m"] / length)
    assert sum(isinstance(patch, Polygon) for patch in map_.patches) > 8
    assert np.asarray(speeds.lines[0].get_ydata())[-1] == pytest.approx(
        sailed.turns["starboard"].speed_ratio, abs=1e-3
    )
    assert np.max(rates.lines[0].get_ydata()) > 0.0 > np.min(rates.lines[1].get_ydata())
    panels = found["zig-zags"].axes
    assert [axis.get_title() for axis in panels] == [
        "10/10, first to starboard",
        "10/10, first to port",
        "20/20, first to starboard",
        "20/20, first to port",
    ]
    said = [text.get_text() for text in panels[0].texts]
    overshoots = sailed.zig_zags[10, "starboard"].overshoots_deg
    assert said == [f"{value:.1f}°" for value in overshoots]
    whole, middle = found["spiral"].axes
    assert np.size(whole.lines[0].get_xdata()) > np.size(middle.lines[0].get_xdata()) > 10


ROLL = """
[roll]
metacentric_height_m = {height}
period_s = 11.0
damping_ratio = 0.06
hull_force_depth_m = 4.5
rudder_force_depth_m = 6.5
"""


def test_a_ship_with_roll_reports_its_heel(shaftline: Command, tmp_path: Path) -> None:
    file, out = tmp_path / "rolling.toml", tmp_path / "out"
    text = (Path(__file__).parents[2] / "plant/ships/ddg-51-surrogate.toml").read_text("utf-8")
    file.write_text(text + ROLL.format(height=0.2), "utf-8")
    result = shaftline("manoeuvre", "--ship", file, "--speed", 11, "--out", out)
    assert result.exit_code == 0, result.output
    for word in ("largest heel inward", "largest heel outward", "steady heel", "no limit"):
        assert word in result.output
    assert "The heel exceeds 20 deg" in result.output
    numbers = json.loads((out / "manoeuvres.json").read_text())
    heel = numbers["turning_circles"]["port"]["heel"]
    track = pd.read_csv(out / "turning-circle-port.csv")["roll_rad"]
    assert heel["inward_rad"] == pytest.approx(-track.min(), rel=1e-6)
    assert heel["outward_rad"] == pytest.approx(track.max(), rel=1e-6)
    assert 0.0 < heel["inward_rad"] < heel["steady_rad"] < heel["outward_rad"]
    rows = {row["criterion"]: row for row in numbers["criteria"]}
    steady = rows["steady heel, turn"]
    assert steady["port"] == pytest.approx(math.degrees(heel["steady_rad"]))
    assert (steady["unit"], steady["limit"], steady["met"]) == ("deg", None, "no limit")
    largest = [rows[f"largest heel {side}, turn"]["port"] for side in ("inward", "outward")]
    assert largest == pytest.approx(np.degrees([heel["inward_rad"], heel["outward_rad"]]))


def test_the_figure_of_a_ship_with_roll_has_its_panel(sailed: Trials) -> None:
    keys = tomllib.loads(ROLL.format(height=1.5))["roll"]
    ship = sailed.ship.with_values({f"roll.{key}": value for key, value in keys.items()})
    turn = turning_circle(ship, approach(ship, 11.0), 0.5)
    figure = trial_figures(sailed._replace(ship=ship, turns={"starboard": turn}))["turning-circles"]
    *_, rates, heels = figure.axes
    assert len(figure.axes) == 4
    drawn = np.asarray(heels.lines[0].get_xydata())[:, 1]
    np.testing.assert_allclose(drawn, np.degrees(turn.track["roll_rad"]))
    assert (rates.get_xlabel(), heels.get_xlabel()) == ("", "way [ship lengths]")


def test_what_is_not_sailed_has_no_figure(sailed: Trials) -> None:
    bare = sailed._replace(
        turns={},
        spiral=None,
        zig_zags={key: one for key, one in sailed.zig_zags.items() if key != (20, "port")},
    )
    found = trial_figures(bare)
    assert set(found) == {"zig-zags"}
    assert [axis.get_visible() for axis in found["zig-zags"].axes] == [True, True, True, False]
