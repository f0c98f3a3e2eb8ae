"""Recordings that repeat each other's rows are refused, whatever they are called."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Options, Recording, diagnose, identify
from shaftline.mismatch.recordings.joint import (
    LEAST_REPEATED,
    flatten,
    load_each,
    refuse_common_rows,
    refuse_overlap,
)
from shaftline.plant import RecordingError, Ship

from .trials import voyage

Given = Callable[[pd.DataFrame, Path], Sequence[Any]]


def _two_names(table: pd.DataFrame, folder: Path) -> Sequence[Any]:
    table.to_csv(folder / "a.csv", index=False)
    shutil.copy(folder / "a.csv", folder / "b.csv")
    return folder / "a.csv", folder / "b.csv"


def _hard_link(table: pd.DataFrame, folder: Path) -> Sequence[Any]:
    table.to_csv(folder / "a.csv", index=False)
    os.link(folder / "a.csv", folder / "b.csv")
    return folder / "a.csv", folder / "b.csv"


def _symbolic_link(table: pd.DataFrame, folder: Path) -> Sequence[Any]:
    table.to_csv(folder / "a.csv", index=False)
    (folder / "b.csv").symlink_to(folder / "a.csv")
    return folder / "a.csv", folder / "b.csv"


REPEATED: dict[str, Given] = {
    "the same frame": lambda table, _: (table, table),
    "a copy of it": lambda table, _: (table, table.copy()),
    "a copy that counts from elsewhere": lambda t, _: (t, t.assign(time_s=t["time_s"] + 1000.0)),
    "a file and its table": lambda table, folder: (_two_names(table, folder)[0], table),
    "a file under two names": _two_names,
    "a hard link": _hard_link,
    "a symbolic link": _symbolic_link,
    "recordings that overlap": lambda t, _: (t.iloc[:1000], t.iloc[900:]),
    "one in the other": lambda t, _: (t, t.iloc[500:700]),
    "without a column": lambda t, _: (t, t.drop(columns="ship_speed_m_s")),
}

COMMANDS: dict[str, Callable[[Ship, Any, Any], Any]] = {
    "diagnose": lambda ship, one, other: diagnose(ship, one, hold_out=[other]),
    "identify": lambda ship, one, other: identify(ship, one, hold_out=[other]),
    "calibrate": lambda ship, one, other: diagnose(ship, one, options=Options(calibrate=(other,))),
    "together": lambda ship, one, other: diagnose(ship, one, other),
}


@pytest.mark.parametrize("given", REPEATED.values(), ids=REPEATED)
@pytest.mark.parametrize("command", COMMANDS)
def test_what_repeats_is_refused(
    command: str, given: Given, frigate: Ship, calm: pd.DataFrame, tmp_path: Path
) -> None:
    one, other = given(calm, tmp_path)
    with pytest.raises(ValueError, match=r"is given twice; |rows \d+ to \d+ are in .* as well; "):
        COMMANDS[command](frigate, one, other)


def test_the_repeated_rows_are_named(frigate: Ship, calm: pd.DataFrame) -> None:
    one, other = flatten(load_each(frigate, [calm.iloc[:1000], calm.iloc[900:]]))
    with pytest.raises(
        RecordingError, match=r"^table 2: rows 1 to 100 are in table 1 as well; why$"
    ):
        refuse_common_rows(one, other, "why")


def test_another_voyage_of_the_same_programme_is_another(frigate: Ship, calm: pd.DataFrame) -> None:
    three = [calm, voyage(frigate, seed=2), voyage(frigate, seed=3)]
    refuse_overlap(flatten(load_each(frigate, three)), "")


def test_rows_that_agree_by_chance_are_no_overlap(frigate: Ship, calm: pd.DataFrame) -> None:
    """A ship at rest with instruments so coarse that they repeat themselves; and a few equal rows."""
    rest = pd.DataFrame({"time_s": 0.1 * np.arange(400.0), "shaft_speed_rad_s": 0.0})
    rest["shaft_torque_N_m"] = np.arange(400.0) // 7 % 2
    still, again = (Recording(Path(name), rest, 0.1, {}) for name in ("a.csv", "b.csv"))
    refuse_common_rows(still, again, "")
    few = voyage(frigate, seed=2)
    few.iloc[50 : 50 + LEAST_REPEATED - 1] = calm.iloc[50 : 50 + LEAST_REPEATED - 1]
    refuse_overlap(flatten(load_each(frigate, [calm, few])), "")


def _constant(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: table[column].mean()})


WRONG: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], str]] = {
    "rpm": (
        lambda t: t.assign(shaft_speed_rad_s=t["shaft_speed_rad_s"] * 9.5493),
        "shaft_speed_rad_s looks like rpm",
    ),
    "kN m": (
        lambda t: t.assign(shaft_torque_N_m=t["shaft_torque_N_m"] / 1e3),
        r"shaft_torque_N_m looks like kN m",
    ),
    "sign": (
        lambda t: t.assign(shaft_torque_N_m=-t["shaft_torque_N_m"]),
        "shaft_torque_N_m looks like itself with the opposite sign",
    ),
    "dead speed": (_constant("shaft_speed_rad_s"), "shaft_speed_rad_s is constant at"),
    "dead torque": (_constant("shaft_torque_N_m"), "shaft_torque_N_m is constant at"),
    "missing": (lambda t: t.drop(columns="fuel_rack_mm"), "column 'fuel_rack_mm' is missing"),
    "hole": (
        lambda t: t.assign(ship_speed_m_s=t["ship_speed_m_s"].where(t.index > 50)),
        "ship_speed_m_s, row 1: 51 values in a row are missing",
    ),
    "time": (lambda t: t.iloc[::-1], "time must rise from row to row"),
    "gap": (lambda t: t[t.index % 12 < 6], "a gap of"),
    "bounds": (
        lambda t: t.assign(pitch_ratio=t["pitch_ratio"].where(t.index != 70, 1e6)),
        "pitch_ratio",
    ),
}


@pytest.mark.parametrize("asked", [diagnose, identify])
@pytest.mark.parametrize("case", WRONG)
def test_a_table_is_refused_for_what_its_file_is_refused_for(
    asked: Callable[[Ship, Any], Any], case: str, frigate: Ship, calm: pd.DataFrame, tmp_path: Path
) -> None:
    spoil, words = WRONG[case]
    if case == "bounds":  # a single one is a spike and mended, in a table as in a file
        calm = calm.assign(pitch_ratio_command=calm["pitch_ratio_command"] * 1e3)
        words = "pitch_ratio_command"
    table = spoil(calm)
    table.to_csv(tmp_path / "trial.csv", index=False)
    said = []
    for source in (tmp_path / "trial.csv", table):
        with pytest.raises(RecordingError, match=words) as error:
            asked(frigate, source)
        said.append(str(error.value).replace(str(tmp_path / "trial.csv"), "table"))
    assert said[0] == said[1]


def test_another_ships_table_is_refused(frigate: Ship, calm: pd.DataFrame) -> None:
    other = calm.assign(
        shaft_speed_rad_s=calm["shaft_speed_rad_s"] * 4.3,
        shaft_torque_N_m=calm["shaft_torque_N_m"] / 150.0,
        ship_speed_m_s=calm["ship_speed_m_s"] * 0.23,
    )
    with pytest.raises(RecordingError, match=r"^table: hardly a recording of frigate"):
        diagnose(frigate, other)
