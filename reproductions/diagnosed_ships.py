"""Compare controllers designed for the ship file, the diagnosed ship and the true ship.

Ten true ships differ from the file by two effects each. The independent simulator of the validation
makes a recording of each, which is diagnosed. Controllers are then designed for the ship of the file,
for the corrected and for the true ship, and evaluated on the true ship.

Run ``python -m reproductions diagnosed_ships --out docs/results --kept out/diagnosed``.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from shaftline.agents.evaluation.episodes import Setting, load_controller, run_episodes
from shaftline.agents.learning.training import train
from shaftline.agents.learning.tuning import tune
from shaftline.core.sweep import SweepError, sweep
from shaftline.display.figures import PALETTE
from shaftline.envs import DEFAULTS
from shaftline.mismatch import catalogue, diagnose
from shaftline.plant import load_ship
from shaftline.plant.ship_files import write_ship
from shaftline.validation.cases import Case, conceal, draw_case
from shaftline.validation.equivalents import comparable
from shaftline.validation.recording import simulate_case_with_sizes
from shaftline.validation.simulator.effects import EFFECTS, FRIGATE

from .pages import make_parser, print_dot
from .policies.trainings import FROM_NOTHING, from_nothing
from .writing import Line, Panel, draw, write_results

TASK, FILE = "speed-keeping", "frigate"
SEED, SHIPS = 3400, 10  # seed and number of the true ships
SIZES = (0.4, 0.8)  # sizes of the effects over their largest plausible size
FIRST_SEED, EPISODES = 900_000, 48
"""Episodes of the evaluation; no training and no search draws their seeds."""

PROGRAMME, SECONDS = "steps", 1200.0
"""Manoeuvres and duration of the recordings, as docs/recordings.md asks for."""

TRAINING_SEED, STEPS = 1, 1_000_000
ROUNDS, TUNING_EPISODES = 12, 16
WIDTHS = {
    "hull.resistance_coefficient_N_s2_m2": 0.3,
    "propeller.relative_rotative_efficiency": 0.1,
    "transmission.inertia_engine_side_kg_m2": 0.1,
}
"""Relative half widths of the domain randomisation: resistance, propeller torque, inertia."""

LEARNED = ("tuned va-pitch", "PPO")  # controllers that are tuned or trained on a ship
KINDS = ("combinator", "va-pitch", *LEARNED)
"""Controllers; the first two are computed from a ship file."""

MADE_FOR = ("file", "corrected", "true")
RANDOMISED = "randomised"


class Truth(NamedTuple):
    """A true ship."""

    name: str
    case: Case  # validation case of its recording
    sizes: dict[str, float]  # of its effects in the independent simulator, by key of the effect


def key_of(effect: str, names: list[str]) -> str | None:
    """Return the key of a ship file for an effect ``ID/BALANCE``; None if there is none.

    ``names`` are those that a report may give to its parameter.
    """
    keys = (
        str(parameter.key)
        for one in catalogue()
        if f"{one.id}/{one.balance}" == effect
        for parameter in one.parameters
        if parameter.key.rpartition(".")[2] in names
    )
    return next(keys, None)


def draw_truths() -> list[Truth]:
    """Return the true ships with two effects each; no effect occurs twice.

    Effects without a key in a ship file and effects in a part of the recording are left out, because an
    environment cannot have them.
    """
    rng = np.random.default_rng(SEED)
    known = [e for e in EFFECTS if e.ship == FRIGATE and e.window is None and comparable(e)]
    order = [known[k] for k in rng.permutation(len(known))][: 2 * SHIPS]
    cases = (draw_case(SEED, index) for index in itertools.count())
    frigates = (case for case in cases if case.ship == FRIGATE and case.kind == "two")
    truths = []
    for k, case in enumerate(itertools.islice(frigates, SHIPS)):
        two = order[2 * k : 2 * k + 2]
        effects = tuple(conceal(one, 1.0, rng) for one in two)
        sizes = {one.key: float(rng.uniform(*SIZES)) * one.most for one in two}
        given: dict[str, Any] = {"programme": PROGRAMME, "seconds": SECONDS, "strength": "strong"}
        truths.append(Truth(f"ship-{k + 1:02d}", replace(case, effects=effects, **given), sizes))
    return truths


def prepare(cell: tuple[Truth, Path]) -> dict[str, Any]:
    """Record and diagnose a true ship; write the true and the corrected ship file.

    Return changed keys of both ships, verdict and identified effects, as JSON allows.
    """
    truth, folder = cell
    place = folder / truth.name
    place.mkdir(parents=True, exist_ok=True)
    reality = simulate_case_with_sizes(truth.case, truth.sizes)
    recording = place / "recording.csv"
    reality.recording.to_csv(recording, index=False)
    file, values = load_ship(FILE), {}
    found = diagnose(file, recording)
    for effect, one in reality.truth["equivalents"].items():
        key = key_of(effect, one["names"])
        if key is None:
            raise ValueError(f"{effect}: this effect has no key in a ship file")
        values[key] = float(one["value"])
    write_ship(file.with_values(values), place / "true.toml")
    write_ship(found.corrected, place / "corrected.toml")
    corrected = {key: float(found.corrected.parameter(key).value) for key in values}
    return {
        "true": values,
        "verdict": str(found.verdict),
        # An infinite value is an absent limit, for which JSON has no number.
        "corrected": {k: value if np.isfinite(value) else None for k, value in corrected.items()},
        "named": [one.effect.id for one in found.findings],
    }


def ship_of(made_for: str, folder: Path) -> str:
    """Return the ship file of a design: ``file``, ``randomised`` or ``SHIP/corrected``."""
    return FILE if made_for in ("file", RANDOMISED) else str(folder / f"{made_for}.toml")


def tune_or_train(cell: tuple[str, str, Path]) -> dict[str, Any]:
    """Tune or train a controller for a ship; return its text for ``load_controller``."""
    kind, made_for, folder = cell
    ship = ship_of(made_for, folder)
    if kind == "PPO":
        kwargs = {"randomise": WIDTHS} if made_for == RANDOMISED else {}
        recipe = from_nothing(TASK, kwargs, n_timesteps=STEPS, evaluations=1)
        place = folder / "trainings" / made_for.replace("/", "-")
        policy = train(recipe, TRAINING_SEED, place, ship=ship, device="cpu", threads=1)
        return {"controller": f"policy:{policy}"}
    name = kind.removeprefix("tuned ")
    found = tune(name, TASK, rounds=ROUNDS, episodes=TUNING_EPISODES, ship=ship, threads=1)
    return {"controller": found.controller}


def evaluate(cell: tuple[str, str, str, Path]) -> dict[str, Any]:
    """Return the returns on the true ship of a controller that was designed for one ship."""
    text, made_for, name, folder = cell
    own = load_ship(ship_of(made_for, folder))
    controller = load_controller(text, own, DEFAULTS.control_interval_s)
    true = str(folder / name / "true.toml")
    kind = ("judged", TASK, "task", DEFAULTS.observer, EPISODES, true)
    kpis, _ = run_episodes(Setting(*kind, first_seed=FIRST_SEED), controller, threads=1)
    return {column: kpis[column].tolist() for column in ("reward", *_SHOWN)}


_SHOWN = ("fuel_kg_nmi", "speed_error_rms_m_s", "overload_s")


def _designs(kind: str) -> tuple[str, ...]:
    """Return the ships for which a controller is designed."""
    return (*MADE_FOR, RANDOMISED) if kind == "PPO" else MADE_FOR


def run(
    folder: Path, kinds: Sequence[str], jobs: int | None
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Compute what is missing in a folder; return diagnoses by ship, and a row for each evaluation."""
    truths = {one.name: one for one in draw_truths()}
    common: dict[str, Any] = {"jobs": jobs, "tick": print_dot}
    ships = sweep(prepare, {n: (t, folder) for n, t in truths.items()}, folder, **common)

    def place(made: str, name: str) -> str:
        return f"{name}/{made}" if made in MADE_FOR[1:] else made

    judged = list(itertools.product(truths, kinds))
    learned = {
        f"learned_{kind}_{place(made, name)}".replace("/", "-").replace(" ", "-"): (
            kind,
            place(made, name),
            folder,
        )
        for name, kind in judged
        if kind in LEARNED
        for made in _designs(kind)
    }
    texts = sweep(tune_or_train, learned, folder, **common)
    made_by = {learned[key][:2]: found["controller"] for key, found in texts.items()}
    cells = {
        (name, kind, made): (made_by.get((kind, where), kind), where, name, folder)
        for name, kind in judged
        for made in _designs(kind)
        for where in [place(made, name)]
    }
    keys = {f"judged_{c[1]}_{c[2]}_{c[0]}".replace(" ", "-"): c for c in cells}
    found = sweep(evaluate, {key: cells[cell] for key, cell in keys.items()}, folder, **common)
    rows = [
        dict(zip(("ship", "controller", "made for"), keys[key], strict=True))
        | {column: float(np.mean(values)) for column, values in one.items()}
        for key, one in found.items()
    ]
    return ships, pd.DataFrame(rows)


def _wide(table: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Return the returns of a controller, a row for each true ship and a column for each design."""
    own = table[table["controller"] == kind]
    return own.pivot(index="ship", columns="made for", values="reward")


def recovered_share(table: pd.DataFrame, kind: str) -> dict[str, Any]:
    """Return the loss of a controller by the ship file, and how much the corrected ship recovers.

    The share is that of the sums over the ships; its interval resamples the ships.
    """
    wide = _wide(table, kind)
    lost = (wide["true"] - wide["file"]).to_numpy()
    back = (wide["corrected"] - wide["file"]).to_numpy()
    rng = np.random.default_rng(0)
    draws = rng.integers(len(lost), size=(_RESAMPLED, len(lost)))
    sums = lost[draws].sum(axis=1)
    shares = np.where(sums > 0.0, back[draws].sum(axis=1) / np.maximum(sums, 1e-9), np.nan)
    shares = shares[np.isfinite(shares)]
    low, high = np.percentile(shares, [2.5, 97.5]) if len(shares) else (np.nan, np.nan)
    return {
        "controller": kind,
        **{made: float(wide[made].mean()) for made in wide.columns},
        "lost": float(lost.mean()),
        "recovered": float(back.mean()),
        "share": float(back.sum() / lost.sum()) if lost.sum() > 0.0 else np.nan,
        "share_low": float(low),
        "share_high": float(high),
    }


_RESAMPLED = 2000


def write(folder: Path, ships: Mapping[str, Any], table: pd.DataFrame) -> Path:
    """Write page, tables and figure."""
    kinds = list(table["controller"].unique())
    rows = pd.DataFrame([recovered_share(table, kind) for kind in kinds])
    shown = pd.DataFrame({"controller": rows["controller"]})
    for made in (*MADE_FOR, RANDOMISED, "lost", "recovered"):
        if made in rows:
            shown[made] = ["–" if np.isnan(x) else f"{x:.1f}" for x in rows[made]]
    percent = 100.0 * rows[["share", "share_low", "share_high"]]
    shown["share recovered"] = [
        f"{share:.0f} % ({low:.0f} to {high:.0f})" for share, low, high in percent.to_numpy()
    ]
    found = pd.DataFrame(
        {
            "ship": name,
            "true ship": "; ".join(f"{key} = {value:.3g}" for key, value in one["true"].items()),
            "corrected ship": "; ".join(
                "none" if v is None else f"{v:.3g}" for v in one["corrected"].values()
            ),
            "verdict": one["verdict"],
            "identified effects": ", ".join(one["named"]),
        }
        for name, one in ships.items()
    )
    each = pd.concat({kind: _wide(table, kind)[list(MADE_FOR)] for kind in kinds}, axis=1)
    each.columns = [", ".join(column) for column in each.columns]
    return write_results(
        __file__, folder, "Value of a diagnosis for controller design", table, {"": figure_of(table)},
        file=FILE, minutes=SECONDS / 60.0, task=TASK, episodes=EPISODES, first=FIRST_SEED,
        rounds=ROUNDS, ppo="PPO" in kinds, recipe=FROM_NOTHING, steps=STEPS, widths=WIDTHS,
        shares=shown, ships=found, each=each.round(1).reset_index(),
    )  # fmt: skip


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the returns by the ship of the design, a panel for each controller."""
    kinds = list(table["controller"].unique())
    panels = []
    for kind in kinds:
        wide = _wide(table, kind)[list(MADE_FOR)]
        lines = [
            Line(MADE_FOR, row, "", PALETTE[k % len(PALETTE)], "o-", 0.8)
            for k, row in enumerate(wide.to_numpy())
        ]
        lines.append(Line(MADE_FOR, wide.mean(), "", "black", width=2.2))
        panels.append(Panel(lines, {"title": kind}))
    figure = draw(panels, (3.0 * len(kinds), 3.4), len(kinds))
    figure.axes[0].set_ylabel("return on the true ship")
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Compute what is missing, and write the page."""
    parser = make_parser(
        "diagnosed_ships", __doc__, "out/diagnosed/page", kept="out/diagnosed", jobs=None
    )
    parser.add_argument(
        "--controllers", nargs="+", choices=KINDS, default=list(KINDS), help="controllers"
    )
    options = parser.parse_args(arguments)
    try:
        ships, table = run(options.kept, options.controllers, options.jobs)
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    print()
    write(options.out, ships, table)


if __name__ == "__main__":
    main()
