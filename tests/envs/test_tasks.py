"""Tasks as data: what comes with the package, and what a user may make of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from shaftline.envs import FrigateEnv, Task, get_task, tasks
from shaftline.envs.settings import read_seas
from shaftline.envs.tasks import HELD_OUT, TaskError, highest_speed
from shaftline.plant import get_sea, load_ship


def test_a_name_a_task_and_its_fields_are_the_same() -> None:
    transit = get_task("transit")
    assert transit == tasks()["transit"]
    assert get_task(transit) is transit
    assert get_task(transit.model_dump()) == transit
    assert list(tasks())[:3] == ["speed-keeping", "transit", "storm"]


@pytest.mark.parametrize("name", tasks())
def test_held_out_is_the_same_task_in_other_seas_and_resistances(name: str) -> None:
    task, held = get_task(name), get_task(f"{name}:{HELD_OUT}")
    assert task.held_out is not None
    assert (held.seas, held.resistance_rise, held.resistance_swing) == (
        task.held_out.seas,
        task.held_out.resistance_rise,
        task.held_out.resistance_swing,
    )
    assert held.resistance_swing > task.resistance_swing
    same = {
        "seas": task.seas,
        "resistance_rise": task.resistance_rise,
        "resistance_swing": task.resistance_swing,
    }
    assert held.model_copy(update=same) == task
    assert all(read_seas(list(seas), task) for seas in (task.seas, held.seas))


AT_SEA = ("rough-sea", "calm-machinery", "acceleration", "flank", "silent")


def _ends(sea: Any) -> dict[str, tuple[float, float]]:
    if isinstance(sea, str):
        one: Any = get_sea(sea)
        sea = {"hs_m": one.hs_m, "tp_s": one.tp_s, "heading_deg": one.heading_deg}
    ends = {key: np.atleast_1d(value) for key, value in sea.items()}
    return {key: (float(pair[0]), float(pair[-1])) for key, pair in ends.items()}


@pytest.mark.parametrize("name", tasks())
def test_each_held_out_sea_lies_outside_the_training_s_in_something(name: str) -> None:
    task, held = get_task(name), get_task(f"{name}:{HELD_OUT}")
    trained = [_ends(sea) for sea in task.seas if sea != "calm"]
    apart = [_ends(sea) for sea in held.seas if sea != "calm"]
    assert apart
    for sea in apart:
        assert any(
            high < min(one[key][0] for one in trained) or low > max(one[key][1] for one in trained)
            for key, (low, high) in sea.items()
        )


@pytest.mark.parametrize("name", AT_SEA)
def test_tasks_name_their_ship(name: str) -> None:
    assert get_task(name).vessel == "frigate-at-sea"
    assert FrigateEnv(task=name).batch.ship == load_ship("frigate-at-sea")


def test_a_sea_of_a_task_may_be_ranges() -> None:
    sea = {"hs_m": (2.0, 2.5), "tp_s": 9.0}
    env = FrigateEnv(task=fields(seas=(sea,)))
    heights = []
    for seed in range(5):
        env.reset(seed=seed)
        record = env.batch.arrays.seas[0]
        heights.append(4.0 * np.sqrt(0.5 * np.sum(record["amplitude"] ** 2)))
    assert all(2.0 <= height <= 2.5 for height in heights)
    assert np.ptp(heights) > 0.05
    with pytest.raises(TaskError, match="the lower value must come first"):
        get_task(fields(seas=({"hs_m": (2.5, 2.0), "tp_s": 9.0},)))


def test_a_storm_ventilates_the_screw() -> None:
    ship = FrigateEnv(task="storm").batch.ship
    assert ship == load_ship("frigate").with_values(dict(get_task("storm").ship))
    assert ship.propeller.depth_m == 3.0
    assert FrigateEnv(task="transit").batch.ship == load_ship("frigate")


@pytest.mark.parametrize("name", ["dancing", "transit:dancing", "", "dancing:held-out"])
def test_unknown_names_are_told_with_the_known(name: str) -> None:
    with pytest.raises(
        TaskError, match=f"unknown task '{name}'; known: speed-keeping, .*:{HELD_OUT}"
    ):
        get_task(name)


def fields(**changes: Any) -> dict[str, Any]:
    return get_task("transit").model_dump() | changes


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"seas": ()}, "seas"),
        ({"joy": 1.0}, "joy"),
        ({"order_interval_s": 0.0}, "order_interval_s"),
        ({"resistance_swing": 1.0}, "resistance_swing"),
        ({"resistance_swing": -0.1}, "resistance_swing"),
        ({"speed_order_m_s": (9.0, 7.0)}, "speed_order_m_s.*the lower value must come first"),
        ({"resistance_rise": (0.3, -0.1)}, "resistance_rise.*the lower value"),
        ({"resistance_rise": (0.0, float("inf"))}, "resistance_rise"),
        ({"resistance_rise": (-0.95, 0.0)}, "resistance_rise = .*-0.95.*must lie within -0.9 to 10"),
        ({"resistance_rise": (0.0, 99.0)}, "resistance_rise = .*99.*must lie within -0.9 to 10"),
        ({"resistance_rise": (-0.8, 0.0), "resistance_swing": 0.2}, "at least 0.05 must remain"),
        ({"speed_order_m_s": (5.0, 400.0)}, "speed_order_m_s = .*must lie within 0 to 40 m/s"),
        ({"drift_force_kN": (0.0, 1e9)}, "drift_force_kN = .*must lie within"),
        ({"held_out": {"seas": ["calm"], "resistance_rise": (-2.0, 1.0), "resistance_swing": 0.1}},
         "held_out: resistance_rise = .*must lie within"),
        ({"goals": {}}, "goals: .*a task needs at least one goal"),
        ({"weights": {}}, "weights"),
        ({"command": "lever"}, "command"),
        ({"held_out": {"seas": ["calm"], "resistance_rise": (1.0, 0.0), "resistance_swing": 0.1}},
         "held_out.resistance_rise"),
    ],
)  # fmt: skip
def test_fields_out_of_range_are_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(TaskError, match=f"(?s)task: .*{words}"):
        get_task(fields(**changes))


@pytest.mark.parametrize("task", [3, None, ("transit",)])
def test_what_is_no_task_is_named(task: Any) -> None:
    with pytest.raises(ValueError, match="must be a name, a Task, or a dictionary of its fields"):
        FrigateEnv(task=task)


def test_ranges_may_be_a_single_value() -> None:
    task = get_task(fields(speed_order_m_s=(8.0, 8.0), resistance_swing=0.0))
    assert isinstance(task, Task)
    with pytest.raises(ValidationError, match="frozen"):
        task.order_interval_s = 5.0
    assert task.speed_order_m_s == (8.0, 8.0)


def test_a_task_without_held_out_seas_keeps_its_own() -> None:
    assert get_task(fields(held_out=None)).held_out is None
    with pytest.raises(ValueError, match="unknown sea 'state-9'"):
        FrigateEnv(task=fields(seas=("state-9",)))
    with pytest.raises(ValueError, match="hull"):
        FrigateEnv(task=fields(ship={"hull.colour": 1.0}))


def test_a_ship_that_is_too_slow_gets_orders_in_proportion() -> None:
    """The ferry reaches 6.60 m/s on its combinator curve, the frigate of the task 11.70 m/s."""
    transit, ferry = get_task("transit"), load_ship("ferry")
    assert highest_speed(ferry) == pytest.approx(6.598, abs=1e-3)
    slow = transit.scale_orders(ferry)
    assert slow.speed_order_m_s == pytest.approx((3.948, 5.076), abs=2e-3)
    assert slow.model_copy(update={"speed_order_m_s": (7.0, 9.0)}) == transit
    env = FrigateEnv(ship="ferry", task="transit")
    env.reset(seed=0)
    orders = env.batch.arrays.episodes["orders"]
    assert (orders > 3.9).all()
    assert (orders < 5.1).all()


def test_orders_that_a_ship_reaches_are_kept() -> None:
    transit, ferry = get_task("transit"), load_ship("ferry")
    for ship in ("frigate", "frigate-at-sea"):
        assert transit.scale_orders(load_ship(ship)) is transit
    reached = transit.model_copy(update={"speed_order_m_s": (4.0, 6.5)})
    assert reached.scale_orders(ferry) is reached
    own = transit.model_copy(update={"vessel": "ferry"})
    assert own.scale_orders(ferry) is own
    weak = ferry.with_values(
        {
            "propeller.pitch_ratio_min": 1.1,
            "prime_mover.torque_limit_at_min_speed_N_m": 100.0,
        }
    )
    assert highest_speed(weak) is None
    assert transit.scale_orders(weak) is transit
