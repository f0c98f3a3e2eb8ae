"""The scorer, on reports whose worth is known."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.validation import cases, run, scoring
from shaftline.validation.comparison import sindy, stepwise_bic
from shaftline.validation.recording import SimulatedCase
from shaftline.validation.scoring import overlap, parameter_of, score, table_of
from shaftline.validation.simulator.instruments import voyage
from shaftline.validation.simulator.parameters import frigate_parameters
from shaftline.validation.simulator.voyage import simulate_voyage


def report(*names: str, balance: str = "engine", verdict: str = "", **parameters: Any) -> Any:
    return {
        "verdict": verdict or ("explained" if names else "nothing-missing"),
        "recording": {"held_out": [[75.0, 100.0]]},
        "location": {"balances": [balance], "windows_s": [[40.0, 70.0]]},
        "effects": [
            {"id": n.split("=")[0], "equivalent_ids": n.split("=")[1:], "parameters": parameters}
            for n in names
        ],
        "fit": {
            "held_out": {
                "before": {"shaft_speed_rad_s": 60.0},
                "after": {"shaft_speed_rad_s": 90.0},
            }
        },
    }


def simulated(kind: str, *keys: str, window: Any = None) -> SimulatedCase:
    time = np.arange(1000) * 0.1
    still = {"time_s": time, "shaft_speed_rad_s": 10.0 + 0.0 * time}
    wave = np.sin(time)
    truth = {
        "case": {
            "kind": kind,
            "index": 0,
            "ship": "frigate",
            "programme": "steps",
            "wave_height": 0.0,
            "strength": "strong",
            "effects": [{"key": k} for k in keys],
        },
        "ratios": dict.fromkeys(keys, 3.0),
        "beyond_tolerances": dict.fromkeys(keys, 2.5),
        "windows": dict.fromkeys(keys, window),
        "equivalents": {
            k: {"names": ["torque_N_m"], "value": 1000.0, "neutral": 0.0} for k in keys
        },
    }
    recording = pd.DataFrame(still)
    recording["shaft_speed_rad_s"] += 4.0 * wave
    concealed = pd.DataFrame(still)
    concealed["shaft_speed_rad_s"] += 3.0 * wave
    return SimulatedCase(recording, truth, pd.DataFrame(still), concealed)


def scored(made: SimulatedCase, given: Any) -> dict[str, Any]:
    return score("tool", given, made.truth, made)


FRICTION = "coulomb-friction/engine"


def test_a_right_name_scores_fully() -> None:
    interval = {"value": 1100.0, "ci95": [950.0, 1250.0]}
    row = scored(simulated("single", FRICTION), report("coulomb-friction", torque_N_m=interval))
    assert row["outcome"] == "named"
    assert row["strength"] == "strong"
    assert row["balance_right"]
    assert row["parameter_error"] == pytest.approx(0.1)
    assert row["covered"] == 1.0
    assert row["oracle_gain"] == pytest.approx(0.75)
    assert row["gain"] == pytest.approx(0.75)
    assert row["gain_fraction"] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("named", "outcome"),
    [
        ("viscous-friction=coulomb-friction", "class"),
        ("engine-derating", "family"),
        ("hull-fouling", "wrong name"),
        ("", "nothing-missing"),
    ],
)
def test_other_names(named: str, outcome: str) -> None:
    given = report(*([named] if named else []), balance="hull")
    row = scored(simulated("single", FRICTION), given)
    assert row["outcome"] == outcome
    assert not row["balance_right"]


def test_nulls_unknowns_and_crashes() -> None:
    assert scored(simulated("null-calm"), report("current"))["outcome"] == "false alarm"
    assert scored(simulated("null-calm"), report())["outcome"] == "nothing-missing"
    still = report(verdict="unexplained") | {"balances": {"engine": {"verdict": "nothing-missing"}}}
    assert scored(simulated("null-calm"), still)["undecided"]
    left = still | {"balances": {"engine": {"verdict": "unexplained"}}}
    assert not scored(simulated("null-calm"), left)["undecided"]
    unknown = simulated("unknown", "warm-bearing/engine")
    assert scored(unknown, report(verdict="unexplained"))["outcome"] == "unexplained"
    assert scored(unknown, report("current"))["outcome"] == "wrong name"
    assert scored(unknown, {"verdict": "failed", "error": "x"})["outcome"] == "failed"


def test_what_is_partly_explained_is_named_as_well() -> None:
    interval = {"value": 1100.0, "ci95": [950.0, 1250.0]}
    given = report("coulomb-friction", verdict="partly-explained", torque_N_m=interval)
    row = scored(simulated("single", FRICTION), given)
    assert (row["outcome"], row["first"]) == ("named", "coulomb-friction")
    assert (row["found"], row["covered"]) == (1, 1.0)
    null = scored(simulated("null-calm"), report("current", verdict="partly-explained"))
    assert null["outcome"] == "false alarm"
    empty = scored(simulated("null-calm"), report(verdict="partly-explained"))
    assert empty["outcome"] == "unexplained"


def test_an_entry_of_the_true_class_is_right() -> None:
    given = report("stribeck-friction")
    assert scored(simulated("single", FRICTION), given)["outcome"] == "wrong name"
    for own in ("coulomb-friction", ["viscous-friction", "coulomb-friction"]):
        given["effects"][0]["class"] = own
        assert scored(simulated("single", FRICTION), given)["outcome"] == "class"


@pytest.mark.parametrize(
    ("kind", "named", "verdict", "sure"),
    [
        ("single", "hull-fouling", "explained", True),
        ("single", "hull-fouling", "partly-explained", False),
        ("single", "hull-fouling=current", "explained", False),
        ("single", "engine-derating", "explained", False),  # of its family
        ("single", "coulomb-friction", "explained", False),
        ("null-calm", "current", "explained", True),
        ("unknown", "current", "explained", True),
    ],
)
def test_a_wrong_confident_name(kind: str, named: str, verdict: str, sure: bool) -> None:
    concealed = {"single": (FRICTION,), "unknown": ("rudder-action/hull",)}.get(kind, ())
    row = scored(simulated(kind, *concealed), report(named, verdict=verdict))
    assert row["wrong_and_sure"] == sure
    value = scoring.tables_of(table_of([row]))["summary"].set_index("figure")["value"]
    (figure,) = (name for name in value.index if name.startswith("wrong confident name"))
    assert value[figure] == float(sure)


def test_numbers_that_are_missing_are_not_scored() -> None:
    gone = {"value": None, "ci95": [None, None]}
    row = scored(simulated("single", FRICTION), report("coulomb-friction", torque_N_m=gone))
    assert row["outcome"] == "named"
    assert "parameter_error" not in row
    open_end = {"value": 1000.0, "ci95": [900.0, None]}
    row = scored(simulated("single", FRICTION), report("coulomb-friction", torque_N_m=open_end))
    assert row["parameter_error"] == 0.0
    assert "covered" not in row


def test_two_effects_need_two_names() -> None:
    two = simulated("two", FRICTION, "hull-fouling/hull")
    assert scored(two, report("hull-fouling", "coulomb-friction"))["found"] == 2
    assert scored(two, report("hull-fouling"))["found"] == 1
    assert scored(two, report("current=hull-fouling", "coulomb-friction"))["found"] == 2
    assert scored(two, report("current=hull-fouling=coulomb-friction"))["found"] == 1


def test_windows_and_parameters() -> None:
    assert overlap([[40.0, 70.0]], [40.0, 70.0]) == 1.0
    assert overlap([[40.0, 55.0], [60.0, 75.0]], [40.0, 70.0]) == pytest.approx(25.0 / 35.0)
    assert overlap([], [40.0, 70.0]) == 0.0
    episode = simulated("single", "resistance-episode/hull", window=[40.0, 70.0])
    assert scored(episode, report("resistance-episode"))["iou"] == 1.0
    wanted = {"names": ["lag_s"]}
    assert parameter_of({"parameters": {"whatever": {"value": 2.0}}}, wanted) == {"value": 2.0}
    assert parameter_of({"parameters": {"a": {"value": 1}, "b": {"value": 2}}}, wanted) is None


def test_the_summary_counts_what_it_says() -> None:
    rows = [scored(simulated("null-calm"), report("current" if i == 0 else "")) for i in range(1)]
    rows += [scored(simulated("null-waves"), report()) for _ in range(3)]
    rows += [scored(simulated("single", FRICTION), report("coulomb-friction"))]
    rows += [scored(simulated("single", FRICTION), report("hull-fouling", balance="hull"))]
    rows += [scored(simulated("unknown", "rudder-action/hull"), report(verdict="unexplained"))]
    for index, row in enumerate(rows):
        row["index"] = index
    tables = scoring.tables_of(table_of(rows))
    value = tables["summary"].set_index("figure")["value"]
    assert value["effects reported in null cases: all"] == 0.25
    assert value["true id or its class first"] == 0.5
    assert value["balance right"] == 0.5
    assert value["effect absent from the catalogue: unexplained or its class"] == 1.0
    grid = scoring.confusion(tables["cases"], "tool")
    assert grid.loc[FRICTION, "hull-fouling"] == 1
    assert tables["strength"].loc[0, "true id first"] == 0.5


@pytest.mark.parametrize("module", ["stepwise-bic", "sindy"])
def test_the_plain_ways_find_a_strong_effect(module: str, tmp_path: Path) -> None:
    if module == "sindy":
        pytest.importorskip("pysindy")
    strong = frigate_parameters(map_rack=0.9)
    demands = voyage("steps", 300.0, 0.1, np.random.default_rng(1))
    path = tmp_path / "recording.csv"
    simulate_voyage(strong, *demands, 0.1).to_csv(path, index=False)
    way = {"stepwise-bic": stepwise_bic, "sindy": sindy}[module]
    found = way.diagnose(path, "frigate", tmp_path, ())
    assert found["verdict"] == "explained"
    assert "engine" in found["location"]["balances"]
    named = found["effects"][0]["id"]
    assert named not in {
        e["id"] for e in way.diagnose(path, "frigate", tmp_path, (named,))["effects"]
    }


def test_a_validation_is_resumed_sealed_and_written(tmp_path: Path) -> None:

    def short(seed: int, index: int) -> cases.Case:
        return dataclasses.replace(cases.draw_case(seed, index), seconds=150.0)

    calls, seals = [], {}

    def diagnose(file: Path, ship: str, out: Path, exclude: tuple[str, ...]) -> Mapping[str, Any]:
        assert not (file.parent / "truth.json").exists()
        assert (file.parent / "sealed.sha256").exists()
        calls.append(ship)
        if len(calls) == 1:
            raise ValueError("cannot")
        return dict(report("coulomb-friction"))

    indices = [i for i in range(20) if cases.case_kind(3, i)[0] in ("null-calm", "null-waves")][:2]
    for _ in range(2):
        for index in indices:
            beside = {"stepwise-bic": stepwise_bic.diagnose}
            rows = run.run_case(short(3, index), tmp_path, diagnose, beside)
            seals[index] = rows[0]["seal"]
    assert len(calls) == len(seals) == 2
    for index, seal in seals.items():
        place = tmp_path / f"case-3-{index:04d}"
        assert (place / "sealed.sha256").read_text().strip() == seal
        truth = json.loads((place / "truth.json").read_text())
        assert cases.hash_truth(truth) == seal
        assert cases.hash_truth(truth | {"sizes": {"a": 1.0}}) != seal
    tables = run.scores(tmp_path)
    run.write_page(tables, tmp_path, "shaftline validate")
    own = tables["cases"][tables["cases"]["tool"] == "shaftline"]
    assert sorted(own["outcome"]) == ["failed", "false alarm"]
    assert set(tables["cases"]["tool"]) == {"shaftline", "stepwise-bic"}
    page = (tmp_path / "validation.md").read_text()
    assert "effects reported in null cases" in page
    assert (tmp_path / "validation-summary.csv").exists()


def test_the_figure_of_confusions(tmp_path: Path) -> None:
    grid = pd.DataFrame(
        [[3, 0, 1], [0, 2, 0]],
        index=["coulomb-friction/engine", "hull-fouling/hull"],
        columns=["coulomb-friction", "hull-fouling", "nothing-missing"],
    )
    scoring.draw_confusion(grid, tmp_path / "grid.png")
    assert (tmp_path / "grid.png").stat().st_size > 5000
