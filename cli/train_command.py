"""Options that the commands that train share.

``shaftline train``.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from ..agents import load_policy
from ..core.files import read_json
from ..envs import DEFAULTS, get_task, tasks
from ..observers import get_observer
from .console import check_folder, clear_errors, needs, print_table, say, stages


class Device(StrEnum):
    """Where the network learns."""

    AUTO = "auto"
    CPU = "cpu"
    CUDA = "cuda"


TaskName = Annotated[str, typer.Option(help=f"One of {', '.join(tasks(None))}.")]
Algorithm = Annotated[str, typer.Option(help="`ppo` or `sac`.")]
Timesteps = Annotated[
    int | None,
    typer.Option(
        min=1, help="Control intervals, all environments together.", show_default="recipe's"
    ),
]
Envs = Annotated[
    int | None,
    typer.Option(min=1, max=4096, help="Environments at once.", show_default="recipe's"),
]
Plans = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=1000,
        help="Episodes that are planned with waves known, and imitated before the learning.",
        show_default="recipe's",
    ),
]
TaskShip = Annotated[
    str | None,
    typer.Option(
        help="Ship: a preset or a .toml file.", show_default="the one the task is made for"
    ),
]
OnDevice = Annotated[Device, typer.Option(help="`auto` takes a GPU where there is one.")]


def sizes(timesteps: int | None, envs: int | None, plans: int | None) -> dict[str, int]:
    """Return those of a recipe's sizes that are given."""
    given = {"n_timesteps": timesteps, "n_envs": envs, "plans": plans}
    return {key: value for key, value in given.items() if value is not None}


def check_device(device: Device) -> None:
    """Refuse a GPU where there is none.

    Raises:
        ValueError: torch sees none.
    """
    import torch

    if device is Device.CUDA and not torch.cuda.is_available():
        raise ValueError("--device cuda: torch sees no GPU here; give cpu or auto")


_CURVE = {
    "steps": "steps", "reward": "reward", "fuel_kg_nmi": "fuel [kg/nmi]",
    "speed_error_rms_m_s": "speed error rms [m/s]", "torque_sd_kN_m": "torque sd [kN m]",
    "failed": "failed [share]",
}  # fmt: skip


def train(
    task: TaskName = "rough-sea",
    algorithm: Algorithm = "ppo",
    recipe: Annotated[
        Path | None,
        typer.Option(
            help="Hyperparameters, FILE.yml with a section a task.",
            show_default="the package's own",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Equal seeds give equal policies.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for policy, curve and checkpoints.",
            show_default="out/train/TASK-ALGORITHM-SEED",
        ),
    ] = None,
    observer: Annotated[
        str | None, typer.Option(help="Observer whose estimate it sees.", show_default="recipe's")
    ] = None,
    timesteps: Timesteps = None,
    envs: Envs = None,
    plans: Plans = None,
    ship: TaskShip = None,
    device: OnDevice = Device.AUTO,
    sensor_noise: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="1: the usual instruments, 0: perfect ones.",
            show_default="recipe's, or 1",
        ),
    ] = None,
) -> None:
    """Train a policy for blade pitch and shaft speed or fuel rack.

    The policy is evaluated several times during the training, on seas that training does not draw; each
    evaluation adds a row to the curve. The last policy is `policy.npz` in the output folder: one file
    with weights and the whole recipe, which runs without torch.

    A recipe may begin with plans: episodes for which the best commands are searched while waves and
    resistance are known. The policy imitates them, from its own observations, before it learns by
    reinforcement. Plans take some seconds each; `--plans 0` leaves them out.

    Stop with Ctrl-C and give the same command again: the training resumes after the last evaluation and
    ends in the same policy as without the stop. Another recipe, seed or ship needs another folder.

    To try something, copy the package's recipe, change it and give it with `--recipe`; its keys are
    those of stable-baselines3, and docs/train.md explains those that stand beside them.

    To watch the losses, if tensorboard is installed (it comes with `shaftline[train]`):
    `tensorboard --logdir OUT/log`.

    Examples:
        shaftline train --task rough-sea --algorithm ppo

        shaftline train --seed 1 --observer luenberger --out out/train/luenberger

        shaftline train --recipe mine.yml --timesteps 200000 --envs 32 --out out/train/mine

        shaftline evaluate --task rough-sea --controller combinator-trimmed --controller policy:rough-sea
    """
    with clear_errors():
        get_task(task).sailed(ship)
        if observer is not None:
            get_observer(observer)
        read_recipe, training = _learning()
        given = {"observer": observer, "sensor_noise": sensor_noise}
        plan = read_recipe(
            algorithm, task, recipe,
            env_kwargs={key: value for key, value in given.items() if value is not None},
            **sizes(timesteps, envs, plans),
        )  # fmt: skip
        folder = out or Path("out/train") / f"{task}-{algorithm}-{seed}"
        check_folder(folder)
        check_device(device)
        before = _evaluations(folder)
        if before:
            say(f"{folder}: resumes after {before} evaluations")
        try:
            with stages("training") as tick:
                policy = training.train(
                    plan, seed, folder, ship=ship, device=device.value,
                    tick=lambda done, total, said: tick(said, done, total),
                )  # fmt: skip
        except KeyboardInterrupt:
            kept = len(list((folder / "plans").glob("*.json")))
            plans_too = f" and {kept} plans" if kept else ""
            say(
                f"stopped after {_evaluations(folder)} evaluations{plans_too}; the same command resumes "
                "there"
            )
            raise typer.Exit(130) from None
        if before == _evaluations(folder):
            say("nothing was left to do")
        _print(policy, folder, plan, training)


def _learning() -> tuple[Any, Any]:
    """What needs the extra: ``read_recipe`` and the module that trains."""
    with needs("train", "training"):
        from ..agents.learning import training
        from ..agents.learning.recipe import read_recipe
    return read_recipe, training


def _evaluations(folder: Path) -> int:
    note = folder / "curve.json"
    return len(read_json(note)) if note.is_file() else 0


def _print(path: Path, folder: Path, plan: Any, training: Any) -> None:
    """Print the curve, the gain over the tuned classic controller, and the next command."""
    policy, task = load_policy(path), plan.task
    observer = plan.env_kwargs.get("observer", DEFAULTS.observer)
    curve = pd.DataFrame(policy.curve)
    shown = curve[list(_CURVE)].rename(columns=_CURVE)
    shown["steps"] = shown["steps"].astype(int)
    shown.insert(0, "evaluation", range(1, len(curve) + 1))
    print_table(shown, f"{folder}: evaluations; the last policy is kept")
    if plan.plans:
        say("evaluation 1, after no step, is that of the imitated plans")
    say(f"{curve['seconds'].iloc[-1] / 60.0:.1f} minutes")
    name, reference = training.reference(plan, policy.about["ship_source"])
    own = curve["reward"].iloc[-1]
    say(
        f"reward in the episodes of the evaluations: the policy {own:.1f}, {name} {reference:.1f} "
        f"({(own - reference) / abs(reference):+.1%})"
    )
    say(f"policy: {path}   curve: {folder / 'curve.json'}   log: {folder / 'log'}")
    say("compare it with a classic controller:")
    other = "" if observer == DEFAULTS.observer else f" --observer {observer}"
    ship = policy.about["ship_source"]
    other += "" if ship == get_task(task).vessel else f" --ship {ship}"
    say(
        f"  shaftline evaluate --controller policy:{path} --controller combinator-trimmed "
        f"--task {task}{other}"
    )
