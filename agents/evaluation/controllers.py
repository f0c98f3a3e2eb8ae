"""Controllers by name: the classic ones, and policies from their files."""

from __future__ import annotations

import hashlib
from pathlib import Path

from ...baselines import ControllerError, controller_names, make_controller
from ...baselines.controller import Predictor
from ...baselines.registry import CONTROLLERS, joined_names, read_options
from ...core.discovery import version_of_others
from ...core.sweep import source_digest
from ...envs.tasks import Task, controller_for
from ...plant import Ship
from ..policy.policy import PolicyError, load_policy, trained

_POLICY = "policy"


def known() -> str:
    """What :func:`load_controller` takes, in words."""
    return f"{', '.join(controller_names())}, your own as module:Class, policy:FILE.npz" + "".join(
        f", {_POLICY}:{name}" for name in trained()
    )


def load_controller(
    text: str, ship: Ship, interval_s: float, task: Task | None = None
) -> Predictor:
    """A controller from ``NAME``, ``NAME:option=number,...`` or ``policy:FILE``.

    Args:
        text: as above; a policy's file, or the name of one that comes with the package.
        ship: the ship that it shall command.
        interval_s: control interval [s].
        task: that it is loaded for. Where that has the rudder as an action, ``HELMSMAN+NAME`` chooses
            who lays it; the task's own helmsman does otherwise.

    Raises:
        ControllerError: unknown name, or an option that the controller does not take.
        PolicyError: not a policy, or one of another version, ship, observation or interval.
    """
    kind, _, source = text.partition(":")
    if kind != _POLICY:
        steered = task is not None and task.steered
        parts = joined_names(text)
        name, _ = read_options(parts[-1])
        if (":" in name or name in controller_names()) and len(parts) <= 1 + steered:
            if task is not None:
                return controller_for(task, text, ship, interval_s, steered)
            return make_controller(text, ship, interval_s)
    if kind != _POLICY or not source:
        raise ControllerError(f"unknown controller {text!r}; known: {known()}")
    policy = load_policy(source, ship)
    own = policy.interval_s
    if abs(own - interval_s) > 1e-9:
        raise PolicyError(
            f"{source}: this policy does not fit: control_interval_s: the policy has {own:g} s, "
            f"here it is {interval_s:g} s"
        )
    return policy


def label(text: str) -> str:
    """Return a controller's name in tables and cells, for a text that :func:`load_controller` took.

    A file may hold another policy or another controller tomorrow. So a policy's name is followed by
    eight letters of its content and of the source that runs it, the name of a user's controller by eight
    letters of its source and of what that imports: results of the old one are then not used again.
    """
    kind, _, source = text.partition(":")
    if kind != _POLICY:
        propulsion = joined_names(text)[-1]
        return f"{text} {version_of_others(read_options(propulsion)[0], CONTROLLERS)}".rstrip()
    path = trained().get(source, Path(source))
    return f"{_POLICY}:{'/'.join(Path(source).parts[-2:])} {version_of(path)}"


def version_of(policy: Path) -> str:
    """Eight letters that change with a policy's file and with what turns its answers into commands."""
    code = source_digest("agents/policy")
    return hashlib.sha256(code.encode() + policy.read_bytes()).hexdigest()[:8]
