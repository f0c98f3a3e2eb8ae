"""Challenge on concealed effects: recordings for any tool, with a sealed truth, and its scores.

A challenge is a folder with one folder for each case (:mod:`.comparison.rival` lists the files) and a
data card. The truth of all cases is one file beside this folder. Its SHA-256, the *seal*, is part of the
challenge, so that the truth cannot change after the first submission.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from ..core.files import (
    LARGEST_RESULT,
    FileError,
    read_text,
    write_atomically,
    write_json,
    write_text,
)
from ..core.sweep import sweep
from ..display.tables import markdown, write_csv
from ..plant import load_ship, write_ship
from .cases import Case, draw_case, indices_of
from .comparison.rival import (
    INPUTS,
    RECORDING,
    REFERENCE,
    SHIP,
    SIMULATION,
    ChallengeCase,
    input_names,
    simulate_inputs,
)
from .comparison.submission import CaseEntry, read_submission
from .localisation import SCORES, SELDOM, TrueLocation
from .recording import CHANNELS, rms, simulate_case
from .scoring import (
    Row,
    median_figure,
    oracle_gains,
    score_with_gains,
    share_figure,
    summary,
    table_of,
)
from .variants import LOGGED_S, PLAIN, VARIANTS, file_text

HELD_OUT_SHARE = 0.25
"""Share of the recording, its end, of which an entrant gets the inputs only."""

LEFT_OUT = ("ablated",)
"""Kinds of cases that are left out: the list of excluded effects would reveal the concealed one."""

SEAL, CARD = "seal.txt", "README.md"
LONGEST_S = 1200.0
ROW_BYTES = 70.0
"""Bytes of the held-out channels of a row in the file of the truth, at most."""

PERIOD_S = 0.1
WORSE = -0.05  # gain below which a model harms the prediction


def truth_file(folder: Path) -> Path:
    """Return the default file of the truth of a challenge: beside its folder."""
    return folder.with_name(f"{folder.name}-truth.json")


def case_indices(seed: int, count: int) -> list[int]:
    """Return the indices of the first cases of a seed whose kinds take part in a challenge."""
    return indices_of(seed, count, lambda kind: kind not in LEFT_OUT)


def check_challenge_size(cases: int, variant: str) -> None:
    """Refuse a challenge whose truth would be too large to be read again.

    Args:
        cases: number of cases.
        variant: one of :data:`.variants.VARIANTS`.

    Raises:
        ValueError: unknown variant, or too many cases; gives the largest number.
    """
    if variant not in VARIANTS:
        raise ValueError(f"--variant {variant}: unknown; known: {', '.join(VARIANTS)}")
    rows = HELD_OUT_SHARE * LONGEST_S / LOGGED_S.get(variant, PERIOD_S)
    most = int(LARGEST_RESULT / (rows * ROW_BYTES))
    if cases > most:
        raise ValueError(f"--cases {cases}: at most {most} with --variant {variant}")


def refuse_content(folder: Path, truth: Path) -> None:
    """Refuse a folder that has content, and a file of the truth that exists.

    Args:
        folder: folder of a new challenge.
        truth: file of its truth.

    Raises:
        ValueError: either would be overwritten.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise ValueError(f"--out {folder}: is not empty; give a new folder")
    if truth.exists():
        raise ValueError(f"{truth}: exists already; remove this truth or give another --out")


def make_challenge(
    folder: Path,
    seed: int,
    cases: int,
    variant: str = PLAIN,
    truth: Path | None = None,
    jobs: int | None = None,
    tick: Callable[[], None] = lambda: None,
) -> str:
    """Write a challenge and its truth; the same arguments give identical files.

    Args:
        folder: new or empty folder of the challenge.
        seed: seed of the cases, which must stay secret: it gives the truth.
        cases: number of cases.
        variant: one of :data:`.variants.VARIANTS`.
        truth: file of the truth, beside the folder by default.
        jobs: processes, by default one for each core.
        tick: called after each case.

    Returns:
        The seal: the SHA-256 of the file of the truth.

    Raises:
        ValueError: the folder has content, the truth exists or lies in the folder, or too many cases.
    """
    truth = truth or truth_file(folder)
    check_challenge_size(cases, variant)
    refuse_content(folder, truth)
    if folder.resolve() in truth.resolve().parents:
        raise ValueError(
            f"--truth {truth}: lies in the published folder {folder}; keep it elsewhere"
        )
    digits = max(3, len(str(cases - 1)))
    cells = {
        f"case-{number:0{digits}d}": (seed, index, variant)
        for number, index in enumerate(case_indices(seed, cases))
    }
    named = {name: (name, cell) for name, cell in cells.items()}
    with TemporaryDirectory() as work:
        found = sweep(partial(_make_case, folder), named, Path(work), jobs=jobs, tick=tick)
    tree = {"variant": variant, "seed": seed, "cases": {name: found[name] for name in cells}}
    text = json.dumps(tree, sort_keys=True, separators=(",", ":"), allow_nan=False) + "\n"
    seal = hashlib.sha256(text.encode()).hexdigest()
    write_text(truth, text)
    write_text(folder / CARD, data_card(cases, variant))
    write_text(folder / SEAL, f"{seal}  truth of {cases} cases (SHA-256)\n")
    return seal


def _make_case(folder: Path, named: tuple[str, tuple[int, int, str]]) -> dict[str, Any]:
    """Write the public files of a case, and return its truth."""
    name, cell = named
    case = draw_case(*cell)
    simulated, place = simulate_case(case), folder / name
    table = simulated.recording
    cut = round(len(table) * (1.0 - HELD_OUT_SHARE))
    fitted, held_out = table.iloc[:cut], table.iloc[cut:].reset_index(drop=True)
    inputs = held_out[input_names(table)]
    _write_ship(case, place / SHIP)
    simulation = simulate_inputs(load_ship(place / SHIP), fitted, inputs).round(6)
    files = {RECORDING: fitted, INPUTS: inputs, SIMULATION: simulation}
    if simulated.healthy is not None:
        files[REFERENCE] = simulated.healthy
    for file, content in files.items():
        write_atomically(place / file, partial(content.to_csv, index=False))
    channels = [channel for channel in CHANNELS if channel in table]
    window = [float(inputs["time_s"].iloc[0]), float(inputs["time_s"].iloc[-1])]
    missed = held_out[channels] - simulation[channels].iloc[cut:].reset_index(drop=True)
    return {
        "truth": simulated.truth,
        "oracle_gains": oracle_gains(simulated, [window]),
        "before": {channel: rms(missed[channel]) for channel in channels},
        "held_out": {c: held_out[c].tolist() for c in ("time_s", *channels)},
    }


def _write_ship(case: Case, path: Path) -> None:
    text = file_text(case)
    if text is None:
        write_ship(load_ship(case.ship), path)
    else:
        write_text(path, text)


@dataclass(frozen=True)
class SealedTruth:
    """Truth of a challenge that matches its seal."""

    variant: str
    cases: dict[str, Any]

    @property
    def held_out_rows(self) -> dict[str, dict[str, int]]:
        """Number of held-out rows of each channel, by case."""
        return {
            name: {c: len(rows) for c, rows in one["held_out"].items() if c != "time_s"}
            for name, one in self.cases.items()
        }


def open_truth(folder: Path, truth: Path | None = None) -> SealedTruth:
    """Return the truth of a challenge.

    Args:
        folder: folder of the challenge.
        truth: file of the truth, beside the folder by default.

    Raises:
        FileError: no seal, an unreadable truth, or one that differs from the sealed one.
    """
    path = truth or truth_file(folder)
    if not (folder / SEAL).is_file():
        raise FileError(f"{folder}: no challenge: it has no {SEAL}")
    seal = read_text(folder / SEAL).split()[:1]
    text = read_text(path, LARGEST_RESULT)
    found = hashlib.sha256(text.encode()).hexdigest()
    if seal != [found]:
        raise FileError(
            f"{path}: its SHA-256 {found} differs from the seal {''.join(seal)} in {folder / SEAL}; "
            "give the truth of this challenge as --truth"
        )
    tree = json.loads(text)
    return SealedTruth(tree["variant"], tree["cases"])


FIGURES = {
    "effects reported in null cases: all": "false alarms: effects named in null cases",
    "null cases called unexplained": "null cases called unexplained",
    "true id first": "single effects: true id first",
    "true id or its class first": "single effects: true id first, or indistinguishable from the first",
    "balance right": "single effects: balance right",
    "parameter error, median": "relative error of the parameter (median, quartiles)",
    "95 % interval covers": "95 % interval of the parameter covers the truth",
    "effect absent from the catalogue: unexplained": "effect absent from the catalogue: called "
    "unexplained",
    "effect absent from the catalogue: a wrong name": "effect absent from the catalogue: a wrong name",
    "two effects: both named": "two effects: both named",
    "insufficient excitation and confounded: not a wrong effect": "confounded effects: no wrong name",
    "wrong confident name: explained, first name neither true nor of its class or family, none "
    "beside it": "all cases: wrong name without an alternative",
    "seconds a diagnosis": "seconds for a case (median, quartiles)",
}
"""Figures of :func:`.scoring.summary` that a challenge reports, with their labels there."""

FAILED = "cases failed"
TIME_F1 = "F1 of the time in which the effect acts (median, quartiles)"
SELDOM_TIME_F1 = "F1 of the time, effects that act at most half of the time (median, quartiles)"
REGIME_F1 = "F1 of the regime in which the effect acts (median, quartiles)"
SELDOM_REGIME_F1 = "F1 of the regime, effects that act in at most half of it (median, quartiles)"
EVERY_ROW = "bound: every row marked"
"""Name, in the column of tools, of the scores of F1 of a tool that marks every row of every case."""

GAIN_FRACTION = "held-out gain relative to the oracle's (median, quartiles)"
GAIN = "held-out gain with an effect (median, quartiles)"
NULL_GAIN = "held-out gain in null cases (median, quartiles)"
HARM = "held-out error 5 % above that of the ship file"


LOCATION = (TIME_F1, SELDOM_TIME_F1, REGIME_F1, SELDOM_REGIME_F1)


@dataclass(frozen=True)
class Scores:
    """Scores of all tools in a challenge.

    Args:
        cases: row for each tool and case.
        count: number of cases.
        variant: variant of the challenge.
    """

    cases: pd.DataFrame
    count: int
    variant: str

    @cached_property
    def figures(self) -> pd.DataFrame:
        """Each figure of each tool: value, 95 % interval by Wilson (of medians: quartiles), cases."""
        rows: list[Row] = []
        for tool, own in self.cases.groupby("tool", sort=False):
            found = []
            if own["names"].any():
                found = summary(own).to_dict("records")
                found = [
                    row | {"figure": FIGURES[row["figure"]]}
                    for row in found
                    if row["figure"] in FIGURES
                ]
                found.append(share_figure(FAILED, own["outcome"] == "failed"))
            if own["names"].any() or own["windows"].any():
                found += _location_figures(own)
            found += _gain_figures(own)
            rows += [{"tool": tool} | row for row in found]
        if any(row["figure"] == TIME_F1 for row in rows):
            found = _location_figures(self.cases.drop_duplicates("case"), "_every_row")
            rows += [{"tool": EVERY_ROW} | row for row in found]
        table = pd.DataFrame(rows)[["figure", "tool", "value", "low", "high", "cases"]]
        table = table[table["cases"] > 0]
        order = {
            name: k
            for k, name in enumerate(
                (*FIGURES.values(), FAILED, *LOCATION, GAIN_FRACTION, GAIN, NULL_GAIN, HARM)
            )
        }
        return table.sort_values(
            "figure", key=lambda c: c.map(order), kind="stable", ignore_index=True
        )

    def write(self, out: Path, command: str) -> Path:
        """Write ``challenge.md``, ``challenge.csv``, ``challenge-cases.csv`` and ``challenge.json``.

        Args:
            out: folder.
            command: command that made the scores.

        Returns:
            The page.
        """
        figures = self.figures
        write_csv(out, "challenge", figures)
        write_csv(out, "challenge-cases", self.cases)
        records = json.loads(figures.to_json(orient="records"))
        write_json(
            out / "challenge.json",
            {"cases": self.count, "variant": self.variant, "figures": records},
        )
        parts = [
            "# Challenge on concealed effects",
            f"{self.count} cases of the variant `{self.variant}`, scored by `{command}`.",
            PREFACE,
            markdown(figures, 3),
        ]
        write_text(out / "challenge.md", "\n\n".join(parts) + "\n")
        return out / "challenge.md"


def _location_figures(own: pd.DataFrame, suffix: str = "") -> list[Row]:
    """Return the figures of F1 of a tool; with the suffix ``_every_row`` those of the bound."""
    time, regime = own[f"time_f1{suffix}"], own[f"regime_f1{suffix}"]
    return [
        median_figure(TIME_F1, time),
        median_figure(SELDOM_TIME_F1, time[own["active_share"] <= SELDOM]),
        median_figure(REGIME_F1, regime),
        median_figure(SELDOM_REGIME_F1, regime[own["active_bins_share"] <= SELDOM]),
    ]


def _gain_figures(own: pd.DataFrame) -> list[Row]:
    """Return the figures of a tool's predictions."""
    null = own["kind"].str.startswith("null")
    gains = own["held_out_gain"]
    return [
        median_figure(GAIN_FRACTION, own["gain_fraction"]),
        median_figure(GAIN, gains[~null]),
        median_figure(NULL_GAIN, gains[null]),
        share_figure(HARM, gains.dropna() < WORSE),
    ]


PREFACE = """\
Shares have Wilson's 95 % interval; of medians, `low` and `high` are the quartiles. The held-out gain is
1 minus the rms error of the prediction over that of the ship file, the mean of all channels: 0 is the
ship file, 1 is perfect, and measurement noise and waves keep it below 1. The oracle knows the true
effect in its true form; its gain is that of the channel that shows the effect best. F1 compares the
reported windows with the rows, and the regime bins, in which the effect changes a channel by more than
its noise; a tool that marks every row has the F1 of the bound. A tool without verdicts is scored by its
windows and predictions only."""


def score_challenge(folder: Path, submissions: list[Path], truth: Path | None = None) -> Scores:
    """Score submissions to a challenge.

    Args:
        folder: folder of the challenge.
        submissions: their JSON files, one for each tool.
        truth: file of the truth, beside the folder by default.

    Returns:
        The scores of every case and their figures.

    Raises:
        FileError: the seal does not match, or a submission cannot be scored.
        ValueError: two submissions have the same tool.
    """
    opened = open_truth(folder, truth)
    places = {
        name: _true_location(folder / name, one["truth"]) for name, one in opened.cases.items()
    }
    rows: list[Row] = []
    for path in submissions:
        found = read_submission(path, opened.held_out_rows)
        if any(row["tool"] == found.tool for row in rows):
            raise ValueError(
                f"{path}: tool {found.tool}: another submission has this name; rename one"
            )
        rows += [
            score_entry(found.tool, name, found.cases[name], one, places[name])
            for name, one in opened.cases.items()
        ]
    table = table_of(rows)
    for name in ("held_out_gain", *SCORES):
        table[name] = pd.to_numeric(table[name]) if name in table else np.nan
    return Scores(table, len(opened.cases), opened.variant)


def _true_location(folder: Path, truth: Mapping[str, Any]) -> TrueLocation:
    """Return when and where the effects of a case act; the truth of an older version has no times."""
    if not (folder / RECORDING).is_file():
        raise FileError(
            f"{folder / RECORDING}: not found; give the complete folder of the challenge"
        )
    return TrueLocation.of(ChallengeCase(folder).recording, truth["active_s"])


def score_entry(
    tool: str, name: str, entry: CaseEntry, sealed: Mapping[str, Any], place: TrueLocation
) -> Row:
    """Return the scores of one entry as a flat row.

    Args:
        tool: name of the tool.
        name: name of the case.
        entry: checked entry.
        sealed: truth of the case.
        place: location of its effects in time and regime.
    """
    before, truth = sealed["before"], sealed["truth"]
    after = {
        channel: rms(np.array(entry.predictions[channel]) - np.array(sealed["held_out"][channel]))
        if channel in entry.predictions
        else before[channel]
        for channel in before
    }
    # The scores depend on ratios of errors only, so that any common scale serves.
    fit = {
        key: {channel: 100.0 * (1.0 - errors[channel] / before[channel]) for channel in before}
        for key, errors in (("before", before), ("after", after))
    }
    report = {
        "verdict": entry.verdict,
        "effects": [effect.model_dump() for effect in entry.effects],
        "error": entry.error,
        "location": {"balances": entry.balances, "windows_s": entry.windows_s},
        "fit": {"held_out": fit if entry.predictions else {}},
    }
    row = score_with_gains(tool, report, truth, sealed["oracle_gains"])
    row |= {"case": name, "seconds": entry.seconds, "names": entry.verdict is not None}
    if entry.predictions:
        gain = float(np.mean([1.0 - after[c] / before[c] for c in before]))
        row["held_out_gain"] = round(gain, 5) + 0.0  # A submission has six significant digits.
        if "gain_fraction" in row:
            row["gain_fraction"] = round(row["gain_fraction"], 5) + 0.0
    row["windows"] = bool(entry.windows_s)
    return row | {key: round(value, 4) for key, value in place.scores(entry.windows_s).items()}


def data_card(cases: int, variant: str) -> str:
    """Return the data card of a challenge.

    Args:
        cases: number of cases.
        variant: one of :data:`.variants.VARIANTS`.
    """
    return CARD_TEXT.format(
        cases=cases,
        variant=variant,
        about=VARIANTS[variant],
        version=version("shaftline"),
        share=f"{100.0 * HELD_OUT_SHARE:.0f} %",
    )


CARD_TEXT = """\
# Challenge: physics that a ship model lacks

{cases} simulated recordings of ships, each with the model that the recording is compared with. In most
cases the simulated ship has one effect, or two, that the model lacks. In others nothing is missing, or
the recording cannot decide. Find out which, and predict the held-out part.

| file of a case | content |
|---|---|
| `recording.csv` | fitted part: commands and measurements, the first three quarters |
| `held_out_inputs.csv` | inputs of the held-out part, the last {share}; its measurements are withheld |
| `simulation.csv` | simulation of the ship file over both parts, from the first measurements |
| `ship.toml` | model of the ship, with the tolerances of its parameters |
| `reference.csv` | recording of a reference period without missing physics (variant realistic only) |

| column | unit | meaning |
|---|---|---|
| `time_s` | s | time since the start |
| `fuel_rack_mm`, `motor_voltage_V` | mm, V | command to the engine, or to the motor of the thruster |
| `pitch_ratio_command`, `pitch_ratio` | - | command and measurement of the pitch, P/D |
| `shaft_speed_rad_s` | rad/s | shaft speed |
| `shaft_torque_N_m` | N m | shaft torque |
| `ship_speed_m_s` | m/s | speed through the water |
| `thrust_N` | N | propeller thrust, in some cases |
| `propeller_submergence_m` | m | depth of the shaft below the surface, in some cases; an input |
| `motor_current_A` | A | armature current of the thruster |

**How it is made.** An independent simulator with its own equations simulates a frigate with a
controllable-pitch propeller, or a DC-motor thruster on a bench. A secret seed draws effect, size,
programme, instruments, noise and sea. Variant `{variant}`: {about}. Made by shaftline {version}.

**Truth.** The truth is not in this folder. `seal.txt` has its SHA-256.

**Submission.** A JSON file with an entry for every case:

```json
{{"tool": "my tool", "cases": {{"case-000": {{
  "verdict": "explained",
  "effects": [{{"id": "coulomb-friction", "equivalent_ids": ["viscous-friction"],
               "parameters": {{"torque_N_m": {{"value": 13900.0, "ci95": [13500.0, 14300.0]}}}}}}],
  "balances": ["engine"], "windows_s": [[0.0, 900.0]],
  "predictions": {{"shaft_speed_rad_s": [11.2, 11.3]}}}}}}}}
```

Verdicts: `explained`, `partly-explained`, `nothing-missing`, `unexplained`, `failed`. Balances:
`engine`, `propeller`, `hull`, `pitch-actuator`, `motor`, `sensor`. `shaftline list --effects` lists the
ids and the parameters of the effects; physics that has no id there is `unexplained`. Effects and
balances stand most probable first. `windows_s` are the times at which the effect acts noticeably: it
changes a channel by more than the standard deviation of the noise. A prediction has a value for each
row of `held_out_inputs.csv`. Every key is optional: an entry without verdict is scored by its windows
and predictions only.

**Licence.** The data are in the public domain (CC0 1.0). The software is under the MIT licence.

**Limits.** The data are simulated. The ids and the parametrisation of the sizes are those of shaftline.
The seed gives the truth, so it must stay secret until the last submission.
"""
