"""The tables in the docstrings of the environments agree with spaces, settings, goals and signals."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from shaftline.envs import DEFAULTS, FrigateEnv, Settings, SteeringEnv, get_task
from shaftline.envs.kernel import OVERSPEED_TRIP, STALL, TRAVERSE_S
from shaftline.envs.residual import REACH
from shaftline.envs.rewards import MEAN_S
from shaftline.plant.signals import get_signal


def table(environment: type[FrigateEnv], head: str) -> list[list[str]]:
    """Return the cells of the table whose head starts with a text, backquotes removed."""
    lines = [line.strip() for line in (environment.__doc__ or "").splitlines()]
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {head}"))
    rows: list[list[str]] = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            return rows
        rows.append([cell.strip().strip("`") for cell in line.strip("|").split("|")])
    return rows


def ends(text: str) -> list[float]:
    """Return the two numbers of ``LOW to HIGH``."""
    return [float(number) for number in text.split(" to ")]


@pytest.mark.parametrize("environment", [FrigateEnv, SteeringEnv])
def test_observation_tables(environment: type[FrigateEnv]) -> None:
    env = environment()
    middle, half = env.batch._scale
    rows = table(environment, "index | signal")
    assert len(rows) == (8 if env.steered else len(env.batch.observed))
    for index, name, unit, scaled, _ in rows:
        i = int(index)
        assert env.batch.observed[i] == name
        assert get_signal(name).unit == unit
        assert ends(scaled) == pytest.approx([middle[i] - half[i], middle[i] + half[i]], rel=5e-4)
    shape = f"``({len(env.batch.observed)},)``"
    assert shape in (environment.__doc__ or "")
    assert isinstance(env.observation_space, gymnasium.spaces.Box)
    assert f"Box({env.observation_space.low[0]:g}, {env.observation_space.high[0]:g})" in str(
        environment.__doc__
    )


def test_every_other_signal_of_a_steered_ship_is_that_of_the_frigate() -> None:
    own = {int(row[0]) for row in table(SteeringEnv, "index | signal")}
    shared = [n for i, n in enumerate(SteeringEnv().batch.observed) if i not in own]
    assert tuple(shared) == FrigateEnv().batch.observed


def test_action_table() -> None:
    rows = table(FrigateEnv, "index | command")
    for index, command, action, scale, meaning in rows:
        env = FrigateEnv(command=DEFAULTS.drive_command if command == "any" else command)
        plant, i = env.batch.ship.record(), int(index)
        assert isinstance(env.action_space, gymnasium.spaces.Box)
        assert ends(action) == [env.action_space.low[i], env.action_space.high[i]]
        gear = plant["gear_ratio"]
        reached = {
            "[-]": [plant["pitch_ratio_min"], plant["pitch_ratio_max"]],
            "[rad/s]": [plant["engine_speed_min"] / gear, plant["engine_speed_max"] / gear],
            "[mm]": [plant["drive_min"], plant["drive_max"]],
        }[meaning.split()[-1]]
        assert ends(scale) == pytest.approx(reached, rel=5e-4)
    assert {row[1] for row in rows} == {"any", "shaft-speed", "limited-rack", "fuel-rack"}


def test_action_ends_are_those_of_the_commands() -> None:
    """An absolute action of -1 or 1 sets the command to the ends in the table."""
    rows = {row[1]: ends(row[3]) for row in table(FrigateEnv, "index | command")}
    for action in (-1.0, 1.0):
        env = FrigateEnv(action_mode="absolute", task="transit", sea="calm")
        env.reset(seed=0)
        env.step([action, action])
        episode, end = env.batch.arrays.episodes[0], int(action > 0.0)
        assert episode["pitch_command"] == pytest.approx(rows["any"][end])
        assert episode["shaft_speed_command"] == pytest.approx(rows["shaft-speed"][end], rel=5e-4)
        assert episode["rack_command"] == pytest.approx(rows["fuel-rack"][end])


def test_goal_table() -> None:
    goals = get_task(DEFAULTS.task).goals.used
    rows = table(FrigateEnv, "reward term")
    assert {row[0] for row in rows} == set(goals)
    for term, within, margin, weight in rows:
        goal = goals[term]
        assert (float(within), float(margin)) == (goal.within, goal.margin)
        assert weight == "factor" if goal.weight is None else float(weight) == goal.weight


def test_argument_table() -> None:
    rows = {row[0]: row[1] for row in table(FrigateEnv, "argument")}
    assert rows.pop("render_mode") == "None"
    assert rows == {name: repr(field.default) for name, field in Settings.model_fields.items()}


def test_numbers_in_the_text() -> None:
    words = " ".join((FrigateEnv.__doc__ or "").split())
    task, env = get_task(DEFAULTS.task), FrigateEnv()
    (slow, fast), rise, interval = task.speed_order_m_s, task.resistance_rise, task.order_interval_s
    for sentence in (
        f"time step ({env.batch.dt:g} s)",
        f"every {DEFAULTS.control_interval_s:g} s",
        f"default ship is ``{task.vessel}``",
        f"crosses its range in {TRAVERSE_S:g} s",
        f"adds {100 * REACH:g} % of the range",
        f"mean over {MEAN_S:g} s",
        f"ordered speeds ({slow:g} to {fast:g} m/s, a new one every {interval:g} s)",
        f"rise of the resistance ({rise[0]:g} to {rise[1]:g})",
        f"amplitude {task.resistance_swing:g})",
        f"at most {100 * STALL:g} % of its lowest",
        f"above {100 * OVERSPEED_TRIP:g} % of its highest",
        f"{DEFAULTS.max_episode_steps} control intervals",
    ):
        assert sentence in words, sentence
    assert f"default task ``{DEFAULTS.task}``" in words


def test_signals_of_the_other_commands() -> None:
    text = FrigateEnv.__doc__ or ""
    assert FrigateEnv(command="fuel-rack").batch.observed[-1] == "fuel_rack_command"
    residual = FrigateEnv(action_mode="residual").batch.observed
    assert residual[-3:] == ("fuel_rack_command", "base_pitch_ratio", "base_fuel_rack")
    assert all(f"`{name}`" in text for name in residual[-3:])
    rudder = SteeringEnv().batch.ship.record()["rudder_max"]
    assert f"({np.degrees(rudder):.0f} degrees)" in " ".join((SteeringEnv.__doc__ or "").split())
