"""What a diagnosis is worth to a controller: made for the file's ship, or for the corrected one.

Ten true ships differ from the file by two effects each, as years at sea leave them. A recording of each
is made by the proof's own equations, which the tool does not share, and diagnosed. Controllers are then
made for the file's ship, for the corrected one and for the true one, and all command the true ship.

Run ``python -m reproductions diagnosed_ships --out docs/results --kept out/diagnosed``. Recordings,
diagnoses, trainings and episodes are kept there, so an interrupted run resumes.
"""

from __future__ import annotations

import argparse
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
from shaftline.display.tables import markdown, write_table
from shaftline.envs import DEFAULTS
from shaftline.mismatch import catalogue, diagnose
from shaftline.plant import load_ship
from shaftline.plant.ship_files import write_ship
from shaftline.validation.cases import Case, conceal, draw_case
from shaftline.validation.equivalents import comparable
from shaftline.validation.reality.effects import EFFECTS, FRIGATE
from shaftline.validation.recording import make_sized

from .policies.trainings import FROM_NOTHING, from_nothing

TASK, FILE = "speed-keeping", "frigate"
SEED, SHIPS = 3400, 10
"""Seed from which the true ships are drawn, and their number."""

SIZES = (0.4, 0.8)
"""Sizes of the effects over the largest that make sense."""

FIRST_SEED, EPISODES = 900_000, 48
"""Episodes on which everything is judged; no training and no search draws their seeds."""

PROGRAMME, SECONDS = "steps", 1200.0
"""Of the recordings: what docs/recordings.md asks for."""

TRAINING_SEED, STEPS = 1, 1_000_000
ROUNDS, TUNING_EPISODES = 12, 16
WIDTHS = {
    "hull.resistance_coefficient_N_s2_m2": 0.3,
    "propeller.relative_rotative_efficiency": 0.1,
    "transmission.inertia_engine_side_kg_m2": 0.1,
}
"""Half widths of the domain randomisation: resistance, torque of the propeller, inertia."""

LEARNED = ("tuned va-pitch", "PPO")
"""Controllers that are searched or trained on a ship."""

KINDS = ("combinator", "va-pitch", *LEARNED)
"""Controllers; the first two are computed from the ship file."""

MADE_FOR = ("file", "corrected", "true")
RANDOMISED = "randomised"


class Truth(NamedTuple):
    """A true ship.

    Args:
        name: of the ship.
        case: of the proof, from which its recording is made.
        sizes: of its effects in the proof's equations, by key of the effect.
    """

    name: str
    case: Case
    sizes: dict[str, float]


def key_of(effect: str, names: list[str]) -> str | None:
    """Return the key of a ship file for an effect of the proof; None where there is none.

    Args:
        effect: as ``ID/BALANCE``.
        names: that a report may give to its parameter.
    """
    name, _, balance = effect.partition("/")
    for one in catalogue():
        if (one.id, one.balance) == (name, balance):
            for parameter in one.parameters:
                if parameter.key.rpartition(".")[2] in names:
                    return str(parameter.key)
    return None


def drawn() -> list[Truth]:
    """Return the true ships: each effect at most once, two for each ship, with sizes, sea and noise.

    Effects without a key in a ship file cannot be given to an environment and are left out, as are
    those that last for a part of the recording.
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
    """Record and diagnose a true ship; write the ships that controllers are made for.

    Returns:
        Keys that the true ship has otherwise than the file, those of the corrected one, the verdict and
        the effects that were named, as JSON allows.
    """
    truth, folder = cell
    place = folder / truth.name
    place.mkdir(parents=True, exist_ok=True)
    reality = make_sized(truth.case, truth.sizes)
    recording = place / "recording.csv"
    reality.recording.to_csv(recording, index=False)
    found = diagnose(load_ship(FILE), recording)
    file = load_ship(FILE)
    values = {}
    for effect, one in reality.truth["equivalents"].items():
        key = key_of(effect, one["names"])
        if key is None:
            raise ValueError(f"{effect}: no key of a ship file")
        values[key] = float(one["value"])
    write_ship(file.with_values(values), place / "true.toml")
    write_ship(found.corrected, place / "corrected.toml")
    return {
        "true": values,
        "corrected": {key: _finite(found.corrected.number(key).value) for key in values},
        "verdict": str(found.verdict),
        "named": [one.effect.id for one in found.findings],
    }


def _finite(value: float) -> float | None:
    """Return a value as JSON allows: an infinite one, a limit that is absent, is None."""
    return float(value) if np.isfinite(value) else None


def ship_of(made_for: str, folder: Path) -> str:
    """Return the ship that a controller is made for: ``file``, ``randomised`` or ``SHIP/corrected``."""
    return FILE if made_for in ("file", RANDOMISED) else str(folder / f"{made_for}.toml")


def learned(cell: tuple[str, str, Path]) -> dict[str, Any]:
    """Tune or train a controller for a ship; returns what ``load_controller`` takes."""
    kind, made_for, folder = cell
    ship = ship_of(made_for, folder)
    if kind == "PPO":
        drawn = {"randomise": WIDTHS} if made_for == RANDOMISED else {}
        recipe = from_nothing(TASK, drawn, n_timesteps=STEPS, evaluations=1)
        place = folder / "trainings" / made_for.replace("/", "-")
        policy = train(recipe, TRAINING_SEED, place, ship=ship, device="cpu", threads=1)
        return {"controller": f"policy:{policy}"}
    name = kind.removeprefix("tuned ")
    found = tune(name, TASK, rounds=ROUNDS, episodes=TUNING_EPISODES, ship=ship, threads=1)
    return {"controller": found.controller}


def judged(cell: tuple[str, str, str, Path]) -> dict[str, Any]:
    """Return the returns of a controller that was made for one ship and commands the true one."""
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
    """Compute whatever is missing in a folder.

    Args:
        folder: where everything is kept.
        kinds: controllers, of :data:`KINDS`.
        jobs: processes.

    Returns:
        The diagnoses by ship, and a row for each controller on each true ship.
    """

    def tick() -> None:
        print(".", end="", flush=True)

    truths = {one.name: one for one in drawn()}
    ships = sweep(
        prepare, {n: (t, folder) for n, t in truths.items()}, folder, jobs=jobs, tick=tick
    )
    own = [f"{name}/{made}" for name in truths for made in MADE_FOR[1:]]
    cells = {
        f"learned_{kind}_{made}".replace("/", "-").replace(" ", "-"): (kind, made, folder)
        for kind in kinds
        if kind in LEARNED
        for made in ("file", *([RANDOMISED] if kind == "PPO" else []), *own)
    }
    texts = sweep(learned, cells, folder, jobs=jobs, tick=tick)
    made_by = {(kind, made): texts[key]["controller"] for key, (kind, made, _) in cells.items()}
    to_judge: dict[str, tuple[str, str, str, Path]] = {}
    keys = []
    for name, kind in itertools.product(truths, kinds):
        for made in (*MADE_FOR, *([RANDOMISED] if kind == "PPO" else [])):
            place = made if made in ("file", RANDOMISED) else f"{name}/{made}"
            key = f"judged_{kind}_{made}_{name}".replace(" ", "-")
            to_judge[key] = (made_by.get((kind, place), kind), place, name, folder)
            keys.append((name, kind, made))
    found = sweep(judged, to_judge, folder, jobs=jobs, tick=tick)
    rows = [
        {"ship": name, "controller": kind, "made for": made}
        | {column: float(np.mean(values)) for column, values in one.items()}
        for (name, kind, made), one in zip(keys, found.values(), strict=True)
    ]
    return ships, pd.DataFrame(rows)


def recovered(table: pd.DataFrame, kind: str) -> dict[str, Any]:
    """Return what a kind of controller loses by the file's ship and gets back by the corrected one.

    The share is that of the sums over the ships; its interval resamples the ships.

    Args:
        table: of :func:`run`.
        kind: of :data:`KINDS`.
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

_TEXT = """\
Ten true ships differ from the file `{file}` by two effects each, drawn with their sizes (two fifths to
four fifths of the largest that makes sense) by a seed; each effect occurs once. A recording of each,
{minutes:.0f} minutes with steps of rack and pitch, is made by the proof's own equations, which the tool
does not share, with its noise and its sea; `shaftline diagnose` sees the recording alone. In the
environment a true ship has each effect in the catalogue's form, of the size that comes nearest to the
proof's.

Controllers are made for the **file**'s ship, for the **corrected** one and for the **true** one, and all
command the true ship in `{task}`: {episodes} episodes from seed {first}, returns of 600 at the most.
`combinator` and `va-pitch` are computed from the ship file; `tuned va-pitch` is searched on that ship
({rounds} rounds).{learned}

*Lost* is the return for the true ship less that for the file's, *recovered* that for the corrected one
less that for the file's; the share is of the sums over the ships, with its 95 % interval over ships. A
share means little where little is lost: then the controller's own feedback makes up for the ship."""

_PPO_TEXT = """ `PPO` is learned from nothing (increments) with the hyperparameters of the recipe of
`{nothing}` and {steps:,} intervals, one training. `randomised`: PPO on the ship file with resistance,
torque of the propeller and inertia drawn anew each episode ({widths})."""

_THREE = """\
## The same on a ship of yours, in three commands

```
shaftline diagnose log.csv --ship frigate --out out/found
shaftline train --task speed-keeping --ship out/found/corrected_ship.toml --out out/policy
shaftline evaluate --task speed-keeping --ship out/found/corrected_ship.toml \\
    --controller combinator --controller policy:out/policy/policy.npz
```"""


def write(folder: Path, ships: Mapping[str, Any], table: pd.DataFrame) -> Path:
    """Write page, tables and figure.

    Args:
        folder: of the results.
        ships: diagnoses by ship.
        table: of :func:`run`.
    """
    kinds = list(table["controller"].unique())
    rows = pd.DataFrame([recovered(table, kind) for kind in kinds])
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
        columns=["ship", "true ship", "corrected ship", "verdict", "named"],
    )
    each = table.assign(what=table["controller"] + ", " + table["made for"]).pivot(
        index="ship", columns="what", values="reward"
    )
    order = [f"{kind}, {made}" for kind in kinds for made in MADE_FOR]
    save(drawn_figure(table), folder / "figures" / f"{NAME}.png")
    widths = ", ".join(f"`{key}` ±{100.0 * width:.0f} %" for key, width in WIDTHS.items())
    ppo = _PPO_TEXT.format(steps=STEPS, widths=widths, nothing=FROM_NOTHING)
    text = _TEXT.format(
        file=FILE, minutes=SECONDS / 60.0, task=TASK, episodes=EPISODES, first=FIRST_SEED,
        rounds=ROUNDS,
        learned=ppo if "PPO" in kinds else "",
    )  # fmt: skip
    parts = [
        text, markdown(shown), "![Lost and recovered](figures/diagnosed-ships.png)",
        "## Ships", "In the unit of the key; what the corrected ship has of it beside.",
        markdown(found),
        "## Ship by ship", markdown(each[order].round(1).reset_index()), _THREE,
    ]  # fmt: skip
    title = "What a diagnosis is worth to a controller"
    write_table(folder, NAME, title, COMMAND, table, "\n\n".join(parts))
    return folder / f"{NAME}.md"


def drawn_figure(table: pd.DataFrame) -> Figure:
    """Draw the return for each ship that a controller was made for, a panel for each kind."""
    kinds = list(table["controller"].unique())
    figure, axes = new_figure(1, len(kinds), (3.0 * len(kinds), 3.4))
    for axis, kind in zip(axes.flat, kinds, strict=True):
        wide = table[table["controller"] == kind].pivot(
            index="ship", columns="made for", values="reward"
        )
        for k, (_, row) in enumerate(wide.iterrows()):
            axis.plot(
                range(3),
                [row[made] for made in MADE_FOR],
                marker="o",
                ms=3,
                lw=0.8,
                color=PALETTE[k % len(PALETTE)],
            )
        axis.plot(range(3), [wide[made].mean() for made in MADE_FOR], color="black", lw=2.2)
        axis.set_xticks(range(3), MADE_FOR)
        axis.set_title(kind, fontsize=9, loc="left")
        axis.tick_params(labelsize=8)
    axes.flat[0].set_ylabel("return on the true ship", fontsize=9)
    return figure


def main(arguments: list[str] | None = None) -> None:
    """Compute what is missing, and write the page."""
    parser = argparse.ArgumentParser(
        "python -m reproductions diagnosed_ships", description=__doc__.split("\n")[0]
    )
    add = parser.add_argument
    add("--out", type=Path, default=Path("out/diagnosed/page"), help="folder of the page")
    add("--kept", type=Path, default=Path("out/diagnosed"), help="folder of everything computed")
    add("--controllers", nargs="+", choices=KINDS, default=list(KINDS), help="controllers")
    add("--jobs", type=int, help="processes; one for each core by default")
    options = parser.parse_args(arguments)
    try:
        ships, table = run(options.kept, options.controllers, options.jobs)
    except SweepError as error:
        parser.exit(1, f"{error}\n")
    print(f"\npage: {write(options.out, ships, table)}")


if __name__ == "__main__":
    main()
