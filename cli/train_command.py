"""``shaftline train``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from ..agents import load_policy
from ..core.files import read_json
from ..envs import DEFAULTS, get_task
from ..observers import get_observer
from . import STOPPED
from .console import (
    announce_loading,
    check_folder,
    print_table,
    report_errors,
    require_extra,
    say,
    say_scaled_orders,
    stages,
)
from .task_options import (
    Algorithm,
    Device,
    Envs,
    OnDevice,
    Plans,
    TaskName,
    TaskShip,
    Timesteps,
    check_device,
    sizes,
)

_CURVE = {
    "steps": "steps",
    "reward": "reward",
    "fuel_kg_nmi": "fuel [kg/nmi]",
    "speed_error_rms_m_s": "speed error rms [m/s]",
    "torque_sd_kN_m": "torque sd [kN m]",
    "failed": "failed [share]",
}


def train(
    task: TaskName = "rough-sea",
    algorithm: Algorithm = "ppo",
    recipe: Annotated[Path | None, typer.Option(
        help="Recipe file (.yml) with a section for each task.",
        show_default="that of the package")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed; equal seeds give equal policies.")] = 0,
    out: Annotated[Path | None, typer.Option(
        help="Folder for policy, curve and checkpoints.",
        show_default="out/train/TASK-ALGORITHM-SEED")] = None,
    observer: Annotated[str | None, typer.Option(
        help="Observer of the advance velocity.", show_default="that of the recipe")] = None,
    timesteps: Timesteps = None,
    envs: Envs = None,
    plans: Plans = None,
    ship: TaskShip = None,
    device: OnDevice = Device.AUTO,
    sensor_noise: Annotated[float | None, typer.Option(
        min=0.0, help="Factor on the sensor noise; 0: perfect sensors.",
        show_default="that of the recipe, or 1")] = None,
) -> None:  # fmt: skip
    """Train a policy for blade pitch and shaft speed or fuel rack.

    The policy is evaluated several times during the training, on seas that training does not draw; each
    evaluation adds a row to the curve. The last policy is kept.

    A recipe can begin with plans: episodes whose commands are optimised with known waves and resistance.
    The policy imitates them from its own observations before reinforcement learning. A plan takes some
    seconds; `--plans 0` leaves them out.

    Stop with Ctrl-C and give the same command again: the training resumes after the last evaluation and
    ends in the same policy as without the stop. Another recipe, seed or ship needs another folder.

    To change hyperparameters, copy the recipe of the package, edit it and give it with `--recipe`. Its
    keys are those of stable-baselines3; docs/train.md explains the additional ones.

    Written: `policy.npz` (one file with weights and recipe, which runs without torch), `curve.json`,
    `checkpoints/` and `log/`. To watch the losses, if tensorboard is installed (it comes with
    `shaftline[train]`): `tensorboard --logdir OUT/log`.

    Examples:
        shaftline train --task rough-sea --algorithm ppo

        shaftline train --seed 1 --observer luenberger --out out/train/luenberger

        shaftline train --recipe mine.yml --timesteps 200000 --envs 32 --out out/train/mine

        shaftline evaluate --task rough-sea --controller combinator-trimmed --controller policy:rough-sea
    """
    with report_errors():
        vessel = get_task(task).load_ship(ship)
        if observer is not None:
            get_observer(observer)
        with require_extra("train", "training"), announce_loading("torch"):
            from ..agents.learning import training
            from ..agents.learning.recipe import read_recipe
        given = {"observer": observer, "sensor_noise": sensor_noise}
        plan = read_recipe(
            algorithm,
            task,
            recipe,
            env_kwargs={key: value for key, value in given.items() if value is not None},
            **sizes(timesteps, envs, plans),
        )
        folder = out or Path("out/train") / f"{task}-{algorithm}-{seed}"
        check_folder(folder)
        check_device(device)
        say_scaled_orders(task, get_task(task), vessel)
        before = _evaluations(folder)
        if before:
            say(f"{folder}: resumes after {before} evaluations")
        try:
            with stages("training") as tick:
                policy = training.train(
                    plan,
                    seed,
                    folder,
                    ship=ship,
                    device=device.value,
                    tick=lambda done, total, said: tick(said, done, total),
                )
        except KeyboardInterrupt:
            kept = len(list((folder / "plans").glob("*.json")))
            said = f"{_evaluations(folder)} evaluations" + (f" and {kept} plans" if kept else "")
            say(f"stopped after {said}; the same command resumes there")
            raise typer.Exit(STOPPED) from None
        if before == _evaluations(folder):
            say("the training is already complete")
        _print(policy, folder, plan, training)


def _evaluations(folder: Path) -> int:
    note = folder / "curve.json"
    return len(read_json(note)) if note.is_file() else 0


def _print(path: Path, folder: Path, plan: Any, training: Any) -> None:
    """Print the curve, the gain over the tuned classic controller, and the next command."""
    policy, task = load_policy(path), plan.task
    observer, ship = plan.env_kwargs.get("observer", DEFAULTS.observer), policy.about["ship_source"]
    curve = pd.DataFrame(policy.curve)
    shown = curve[list(_CURVE)].rename(columns=_CURVE)
    shown["steps"] = shown["steps"].astype(int)
    shown.insert(0, "evaluation", range(1, len(curve) + 1))
    print_table(shown, f"{folder}: evaluations; the last policy is kept")
    if plan.plans:
        say("evaluation 1 is that of the imitated plans, before reinforcement learning")
    say(f"{curve['seconds'].iloc[-1] / 60.0:.1f} minutes")
    name, reference = training.reference(plan, ship)
    own = curve["reward"].iloc[-1]
    say(
        f"reward in the episodes of the evaluations: the policy {own:.1f}, {name} {reference:.1f} "
        f"({(own - reference) / abs(reference):+.1%})"
    )
    say(f"policy: {path}   curve: {folder / 'curve.json'}   log: {folder / 'log'}")
    say("compare it with a classic controller:")
    other = "" if observer == DEFAULTS.observer else f" --observer {observer}"
    other += "" if ship == get_task(task).vessel else f" --ship {ship}"
    say(
        f"  shaftline evaluate --controller policy:{path} --controller combinator-trimmed "
        f"--task {task}{other}"
    )
