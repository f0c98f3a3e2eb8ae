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
from shaftline.display.figures import PALETTE, new_figure, save
from shaftline.display.tables import write_table
from shaftline.envs import DEFAULTS
from shaftline.mismatch import catalogue, diagnose
from shaftline.plant import load_ship
from shaftline.plant.ship_files import write_ship
from shaftline.validation.cases import Case, conceal, draw_case
from shaftline.validation.equivalents import comparable
from shaftline.validation.reality.effects import EFFECTS, FRIGATE
from shaftline.validation.recording import simulate_case_with_sizes

from .pages import fill_template, make_parser, print_dot
from .policies.trainings import FROM_NOTHING, from_nothing

TASK, FILE = "speed-keeping", "frigate"
SEED, SHIPS = 3400, 10
"""Seed and number of the true ships."""

SIZES = (0.4, 0.8)
"""Sizes of the effects over their largest plausible size."""

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

LEARNED = ("tuned va-pitch", "PPO")
"""Controllers that are tuned or trained on a ship."""

KINDS = ("combinator", "va-pitch", *LEARNED)
"""Controllers; the first two are computed from a ship file."""

MADE_FOR = ("file", "corrected", "true")
RANDOMISED = "randomised"


class Truth(NamedTuple):
    """A true ship.

    Args:
        name: name of the ship.
        case: validation case of its recording.
        sizes: sizes of its effects in the independent simulator, by key of the effect.
    """

    name: str
    case: Case
    sizes: dict[str, float]


def key_of(effect: str, names: list[str]) -> str | None:
    """Return the key of a ship file for an effect of the independent simulator; None if there is none.

    Args:
        effect: as ``ID/BALANCE``.
        names: names that a report may give to its parameter.
    """
    name, _, balance = effect.partition("/")
    for one in catalogue():
        if (one.id, one.balance) == (name, balance):
            for parameter in one.parameters:
                if parameter.key.rpartition(".")[2] in names:
                    return str(parameter.key)
    return None


def draw_truths() -> list[Truth]:
    """Return the true ships with two effects each; no effect occurs twice.

    Effects without a key in a ship file and effects in a part of the recording are left out, because an
    environment cannot have them.
    """
    rng = np.random.default_rng(SEED)
    known = [
        one for one in EFFECTS if one.ship == FRIGATE and one.window is None and comparable(one)
    ]
    order = [known[k] for k in rng.permutation(len(known))][: 2 * SHIPS]
    frigates = (
        case
        for index in itertools.count()
        if (case := draw_case(SEED, index)).ship == FRIGATE and case.kind == "two"
    )
    truths = []
    for k, case in enumerate(itertools.islice(frigates, SHIPS)):
        two = order[2 * k : 2 * k + 2]
        effects = tuple(conceal(one, 1.0, rng) for one in two)
        sizes = {one.key: float(rng.uniform(*SIZES)) * one.most for one in two}
        known_case = replace(
            case, effects=effects, programme=PROGRAMME, seconds=SECONDS, strength="strong"
        )
        truths.append(Truth(f"ship-{k + 1:02d}", known_case, sizes))
    return truths


def prepare(cell: tuple[Truth, Path]) -> dict[str, Any]:
    """Record and diagnose a true ship; write the true and the corrected ship file.

    Returns:
        Changed keys of the true ship, the same keys of the corrected ship, the verdict and the
        identified effects, as JSON allows.
    """
    truth, folder = cell
    place = folder / truth.name
    place.mkdir(parents=True, exist_ok=True)
    reality = simulate_case_with_sizes(truth.case, truth.sizes)
    recording = place / "recording.csv"
    reality.recording.to_csv(recording, index=False)
    found = diagnose(load_ship(FILE), recording)
    file = load_ship(FILE)
    values = {}
    for effect, one in reality.truth["equivalents"].items():
        key = key_of(effect, one["names"])
        if key is None:
            raise ValueError(f"{effect}: this effect has no key in a ship file")
        values[key] = float(one["value"])
    write_ship(file.with_values(values), place / "true.toml")
    write_ship(found.corrected, place / "corrected.toml")
    return {
        "true": values,
        "corrected": {key: _finite(found.corrected.parameter(key).value) for key in values},
        "verdict": str(found.verdict),
        "named": [one.effect.id for one in found.findings],
    }


def _finite(value: float) -> float | None:
    """Return a value as JSON allows: None for an infinite one, which is an absent limit."""
    return float(value) if np.isfinite(value) else None


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
    setting = Setting(
        "judged", TASK, "task", DEFAULTS.observer, EPISODES, true, first_seed=FIRST_SEED
    )
    kpis, _ = run_episodes(setting, controller, threads=1)
    return {column: kpis[column].tolist() for column in ("reward", *_SHOWN)}


_SHOWN = ("fuel_kg_nmi", "speed_error_rms_m_s", "overload_s")


def run(
    folder: Path, kinds: Sequence[str], jobs: int | None
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Compute all results that are missing in a folder.

    Args:
        folder: folder of intermediate results.
        kinds: controllers of :data:`KINDS`.
        jobs: number of processes.

    Returns:
        The diagnoses by ship, and a row for each controller on each true ship.
    """
    truths = {one.name: one for one in draw_truths()}
    ships = sweep(
        prepare, {n: (t, folder) for n, t in truths.items()}, folder, jobs=jobs, tick=print_dot
    )
    own = [f"{name}/{made}" for name in truths for made in MADE_FOR[1:]]
    cells = {
        f"learned_{kind}_{made}".replace("/", "-").replace(" ", "-"): (kind, made, folder)
        for kind in kinds
        if kind in LEARNED
        for made in ("file", *([RANDOMISED] if kind == "PPO" else []), *own)
    }
    texts = sweep(tune_or_train, cells, folder, jobs=jobs, tick=print_dot)
    made_by = {(kind, made): texts[key]["controller"] for key, (kind, made, _) in cells.items()}
    to_judge: dict[str, tuple[str, str, str, Path]] = {}
    keys = []
    for name, kind in itertools.product(truths, kinds):
        for made in (*MADE_FOR, *([RANDOMISED] if kind == "PPO" else [])):
            place = made if made in ("file", RANDOMISED) else f"{name}/{made}"
            key = f"judged_{kind}_{made}_{name}".replace(" ", "-")
            to_judge[key] = (made_by.get((kind, place), kind), place, name, folder)
            keys.append((name, kind, made))
    found = sweep(evaluate, to_judge, folder, jobs=jobs, tick=print_dot)
    rows = [
        {"ship": name, "controller": kind, "made for": made}
        | {column: float(np.mean(values)) for column, values in one.items()}
        for (name, kind, made), one in zip(keys, found.values(), strict=True)
    ]
    return ships, pd.DataFrame(rows)


def recovered_share(table: pd.DataFrame, kind: str) -> dict[str, Any]:
    """Return the loss of a controller by the ship file, and how much the corrected ship recovers.

    The share is that of the sums over the ships; its interval resamples the ships.
    """
    wide = table[table["controller"] == kind].pivot(
        index="ship", columns="made for", values="reward"
    )
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
NAME = "diagnosed-ships"
COMMAND = "python -m reproductions diagnosed_ships --out docs/results"


def write(folder: Path, ships: Mapping[str, Any], table: pd.DataFrame) -> Path:
    """Write page, tables and figure."""
    kinds = list(table["controller"].unique())
    rows = pd.DataFrame([recovered_share(table, kind) for kind in kinds])
    shown = pd.DataFrame({"controller": rows["controller"]})
    randomised = [RANDOMISED] if RANDOMISED in rows else []
    for made in (*MADE_FOR, *randomised, "lost", "recovered"):
        shown[made] = ["–" if np.isnan(x) else f"{x:.1f}" for x in rows[made]]
    shown["share recovered"] = [
        f"{100.0 * r['share']:.0f} % ({100.0 * r['share_low']:.0f} to {100.0 * r['share_high']:.0f})"
        for _, r in rows.iterrows()
    ]
    found = pd.DataFrame(
        [
            (
                name,
                "; ".join(f"{key} = {value:.3g}" for key, value in one["true"].items()),
                "; ".join(
                    "none" if value is None else f"{value:.3g}"
                    for value in one["corrected"].values()
                ),
                one["verdict"],
                ", ".join(one["named"]),
            )
            for name, one in ships.items()
        ],
        columns=["ship", "true ship", "corrected ship", "verdict", "identified effects"],
    )
    each = table.assign(what=table["controller"] + ", " + table["made for"]).pivot(
        index="ship", columns="what", values="reward"
    )
    order = [f"{kind}, {made}" for kind in kinds for made in MADE_FOR]
    save(figure_of(table), folder / "figures" / f"{NAME}.png")
    text = fill_template(
        Path(__file__).with_name("diagnosed_ships.md"), file=FILE, minutes=SECONDS / 60.0,
        task=TASK, episodes=EPISODES, first=FIRST_SEED, rounds=ROUNDS, ppo="PPO" in kinds,
        recipe=FROM_NOTHING, steps=STEPS, widths=WIDTHS, shares=shown, ships=found,
        each=each[order].round(1).reset_index(),
    )  # fmt: skip
    write_table(folder, NAME, "Value of a diagnosis for controller design", COMMAND, table, text)
    return folder / f"{NAME}.md"


def figure_of(table: pd.DataFrame) -> Figure:
    """Draw the returns by the ship of the design, a panel for each controller."""
    kinds = list(table["controller"].unique())
    figure, axes = new_figure(1, len(kinds), (3.0 * len(kinds), 3.4))
    for axis, kind in zip(axes.flat, kinds, strict=True):
        wide = table[table["controller"] == kind].pivot(
            index="ship", columns="made for", values="reward"
        )
        for k, (_, row) in enumerate(wide.iterrows()):
            values, colour = [row[made] for made in MADE_FOR], PALETTE[k % len(PALETTE)]
            axis.plot(range(3), values, marker="o", ms=3, lw=0.8, color=colour)
        axis.plot(range(3), [wide[made].mean() for made in MADE_FOR], color="black", lw=2.2)
        axis.set_xticks(range(3), MADE_FOR)
        axis.set_title(kind, fontsize=9, loc="left")
        axis.tick_params(labelsize=8)
    axes.flat[0].set_ylabel("return on the true ship", fontsize=9)
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
    print(f"\npage: {write(options.out, ships, table)}")


if __name__ == "__main__":
    main()
