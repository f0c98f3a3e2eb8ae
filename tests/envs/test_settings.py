"""What a user may vary: every default, what each choice becomes, and what is refused by name."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.envs import CLASSIC, DEFAULTS, FrigateEnv, FrigateVectorEnv, Settings, get_task
from shaftline.envs.options import OPTIONS, ResetOptions
from shaftline.envs.settings import check_randomise, noise_record, read_seas
from shaftline.plant import Sea, get_sea, load_ship

TRANSIT = get_task("transit")
SPEEDS = (4.0, 10.0)
PAGE = (Path(__file__).parents[2] / "docs/environment.md").read_text(encoding="utf-8")


def test_defaults() -> None:
    assert DEFAULTS.model_dump() == {
        "ship": None,
        "task": "speed-keeping",
        "observer": "random-walk-kalman",
        "tuning": None,
        "sea": None,
        "sensor_noise": 1.0,
        "control_interval_s": 0.5,
        "max_episode_steps": 600,
        "randomise": None,
        "normalised": True,
        "action_mode": "increment",
        "command": None,
        "order_profile": None,
    }
    assert FrigateEnv().batch.settings == FrigateVectorEnv(2).batch.settings == DEFAULTS


def test_the_page_tells_every_keyword_and_option() -> None:
    table = re.search(r"\| keyword \|.*?\n\n", PAGE, re.DOTALL)
    options = re.search(r"\| option \|.*?\n\n", PAGE, re.DOTALL)
    assert table is not None
    assert options is not None

    def first_column(text: str) -> list[str]:
        cells = re.findall(r"^\| (`.*?) \|", text, re.MULTILINE)
        return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]

    known = list(Settings.model_fields)
    assert sorted(first_column(table[0])) == sorted(
        [*known, "render_mode", "threads", "autoreset_mode"]
    )
    assert first_column(options[0]) == list(OPTIONS)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"fog": 1}, "unexpected keyword argument 'fog'; known: ship, task, observer"),
        (
            {"action_mode": "drift"},
            "unknown action_mode 'drift'; known: increment, absolute, residual, and",
        ),
        ({"action_mode": "increment:combinator"}, "unknown action_mode 'increment:combinator'"),
        ({"action_mode": "shaft-speed"}, "unknown action_mode 'shaft-speed'"),
        (
            {"action_mode": "residual", "command": "shaft-speed"},
            "command = 'shaft-speed': a residual is added to the fuel rack .*limited-rack or fuel-rack",
        ),
        (
            {"command": "rack"},
            "unknown command 'rack'; known: shaft-speed, limited-rack, fuel-rack",
        ),
        ({"max_episode_steps": 0}, "max_episode_steps = 0: must be a whole number .* from 1 to"),
        ({"max_episode_steps": -1}, "max_episode_steps = -1: must be a whole number"),
        ({"max_episode_steps": 10_000_001}, "max_episode_steps = 10000001: .*10 000 000, or None"),
        ({"max_episode_steps": 9.5}, "max_episode_steps = 9.5: must be a whole number"),
        ({"max_episode_steps": True}, "max_episode_steps = True: must be a whole number"),
        ({"max_episode_steps": "300"}, "max_episode_steps = '300': must be a whole number"),
        ({"episode_s": 300.0}, "unexpected keyword argument 'episode_s'"),
        ({"control_interval_s": 0.0}, r"control_interval_s = 0\.0 s: must be .* above 0"),
        ({"control_interval_s": -0.5}, r"control_interval_s = -0\.5 s: must be .* above 0"),
        ({"control_interval_s": math.inf}, "control_interval_s = inf s: must be .* finite"),
        ({"normalised": "no"}, "normalised = 'no': must be True or False"),
        ({"normalised": 1}, "normalised = 1: must be True or False"),
        ({"normalised": None}, "normalised = None: must be True or False"),
        ({"observer": None}, "observer = None: must be the name of an observer"),
        ({"tuning": 3}, "tuning = 3: must be the name of a tuning, or None"),
        (
            {"sensor_noise": "loud"},
            "sensor_noise = 'loud': must be a factor of at least 0.*, or an rms",
        ),
        ({"sensor_noise": None}, "sensor_noise = None: must be a factor of at least 0"),
        ({"randomise": 0.1}, "randomise = 0.1: must map keys of the ship file to half widths"),
        ({"randomise": {"hull.mass_kg": "much"}}, "'hull.mass_kg'. = 'much': must be a half width"),
        ({"action_mode": None}, "action_mode = None: must be one of increment, absolute, residual"),
    ],
)
def test_keywords_out_of_range_are_named(keywords: dict[str, Any], words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        Settings.of(keywords)


def test_an_unknown_keyword_is_a_type_error() -> None:
    """As Python has it, and as wrappers that try keywords expect (TorchRL's ``frameskip``)."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        FrigateEnv(frameskip=1)


def test_the_second_action_commands_the_shaft_speed_unless_chosen() -> None:
    assert Settings().drive_command == "shaft-speed"
    assert Settings(command="fuel-rack").drive_command == "fuel-rack"
    assert Settings(action_mode="residual").drive_command == "limited-rack"
    chosen = Settings(action_mode="residual", command="fuel-rack")
    assert chosen.drive_command == "fuel-rack"


def test_a_residual_names_its_base_controller() -> None:
    assert Settings(action_mode="residual").base_controller == "speed-pilot"
    named = Settings(action_mode="residual:combinator:trim_s=20")
    assert named.base_controller == "combinator:trim_s=20"
    assert Settings().base_controller is Settings(action_mode="absolute").base_controller is None
    with pytest.raises(ValueError, match="unknown controller 'unknown'; known: combinator"):
        FrigateEnv(action_mode="residual:unknown")


def test_classic_keywords_give_units_and_commands_as_actions() -> None:
    assert CLASSIC == {"normalised": False, "action_mode": "absolute", "command": "fuel-rack"}


def test_an_interval_is_whole_plant_steps() -> None:
    assert Settings().steps(0.05) == 10
    assert Settings(control_interval_s=0.05).steps(0.05) == 1
    assert Settings(control_interval_s=0.3).steps(0.1) == 3  # despite rounding in floating point
    for interval in (0.12, 0.05 + 1e-8, 0.01):
        with pytest.raises(
            ValueError, match=f"control_interval_s = {interval!r} s: .*step of 0.05 s"
        ):
            Settings(control_interval_s=interval).steps(0.05)


def test_seas_are_presets_parameters_ranges_and_lists_of_them() -> None:
    state_5 = get_sea("state-5")
    assert read_seas("calm", TRANSIT) == [None]
    assert read_seas("state-5", TRANSIT) == [(state_5, state_5)]
    assert read_seas(state_5, TRANSIT) == [(state_5, state_5)]
    assert read_seas(None, TRANSIT) == [(get_sea(name),) * 2 for name in TRANSIT.presets]
    low, high = Sea(hs_m=1.0, tp_s=9.0), Sea(hs_m=5.0, tp_s=9.0)
    assert read_seas({"hs_m": (1.0, 5.0), "tp_s": 9.0}, TRANSIT) == [(low, high)]
    assert read_seas({"hs_m": [1.0], "tp_s": (9.0, 9.0)}, TRANSIT) == [(low, low)]
    both = read_seas(["calm", {"hs_m": 1.0, "tp_s": 9.0}], TRANSIT)
    assert both == [None, (low, low)]


@pytest.mark.parametrize(
    ("sea", "words"),
    [
        ("state-9", "unknown sea 'state-9'"),
        ({"hs_m": (4.0, 1.0), "tp_s": 9.0}, r"sea\['hs_m'\] = \(4\.0, 1\.0\): .*or a pair"),
        ({"hs_m": (1.0, 2.0, 4.0), "tp_s": 9.0}, r"sea\['hs_m'\]"),
        ({"hs_m": (), "tp_s": 9.0}, r"sea\['hs_m'\]"),
        ({"hs_m": 30.0, "tp_s": 9.0}, "(?s)hs_m.*less than or equal to 25"),
        ({"hs_m": 3.0}, "tp_s is missing"),
        ({"hs_m": 3.0, "tp_s": 9.0, "wind": 1.0}, "wind"),
        ([], r"sea = \[\]: must be a preset"),
        (5, "sea = 5: must be a preset"),
        (["calm", "state-9"], "unknown sea 'state-9'"),
    ],
)
def test_seas_that_do_not_exist_are_named(sea: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read_seas(sea, TRANSIT)
    with pytest.raises(ValueError, match=words):
        FrigateEnv(sea=sea)


def test_usual_instruments_follow_the_ships_full_scale() -> None:
    frigate, ferry = load_ship("frigate"), load_ship("ferry")
    usual = {
        "shaft_speed": 1e-3 * 1000.0 * math.pi / 30.0 / 7.38,
        "shaft_torque": 5e-3 * 38e3 * 7.38,
        "pitch_ratio": 4e-3,
        "shaft_acceleration": 2e-2,
        "ship_speed": 5e-2,
        "heading": math.radians(0.1),
        "yaw_rate": math.radians(0.02),
        "rudder_angle": math.radians(0.1),
        "cross_track": 5e-2,
        "wave_inflow": 5e-2,
    }
    for share in (1.0, 0.5, 0.0):
        record = noise_record(frigate, share)
        assert {name: record[name] for name in record.dtype.names} == pytest.approx(
            {name: share * rms for name, rms in usual.items()}
        )
    top = ferry.shaft_speeds[1]
    assert noise_record(ferry, 1.0)["shaft_speed"] == pytest.approx(1e-3 * top)
    unlimited = frigate.with_values({"prime_mover.torque_limit_N_m": math.inf})
    assert noise_record(unlimited, 1.0)["shaft_torque"] == 0.0


def test_rms_by_instrument_leaves_the_others_perfect() -> None:
    record = noise_record(load_ship("frigate"), {"ship_speed": 0.2, "pitch_ratio": 0.0})
    assert record.tolist() == (0.0, 0.0, 0.0, 0.0, 0.2, *5 * (0.0,))


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (-0.1, r"sensor_noise = -0\.1: must be at least 0"),
        (math.inf, "sensor_noise = inf"),
        ({"smell": 1.0}, r"sensor_noise\['smell'\] = 1\.0: .*shaft_speed, shaft_torque"),
        ({"ship_speed": -0.1}, r"sensor_noise\['ship_speed'\] = -0\.1"),
        ({"ship_speed": math.inf}, "ship_speed"),
    ],
)
def test_noise_out_of_range_is_named(noise: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        noise_record(load_ship("frigate"), noise)


@pytest.mark.parametrize(
    ("key", "width", "words"),
    [
        ("integration.time_step_s", 0.1, "integration.time_step_s sets the integration"),
        ("colour", 0.1, r"randomise\['colour'\] = 0\.1: not the key of a number in the ship file"),
        ("hull.colour", 0.1, "not the key of a number in the ship file"),
        ("resistance_coefficient", 0.1, "not the key of a number"),  # the record's name
        ("prime_mover", 0.1, "not the key of a number"),
        ("prime_mover.type", 0.1, "not the key of a number"),
        ("hull.propellers", 0.1, "not the key of a number"),
        ("hull.mass_kg", 1.0, r"= 1\.0: must be a half width from 0 to below 1"),
        ("hull.mass_kg", -0.1, "half width"),
        ("hull.mass_kg", math.nan, "half width"),
        ("hull.fouling_fraction", 0.1, "the value on this ship is 0, which a factor cannot vary"),
        ("prime_mover.rack_rate_limit_mm_s", 0.1, "the value on this ship is inf"),
        ("transmission.efficiency", 0.1, r"0\.855 to 1\.045 leaves .* 0\.3 to 1 \(unit -\)"),
        ("pitch_actuator.time_constant_s", 0.98, r"0\.04 to 3\.96 .* 0\.05 to 100 \(unit s\)"),
    ],
)
def test_what_a_factor_cannot_vary_is_named(key: str, width: float, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(f"randomise[{key!r}]") + f".*{words}|{words}"):
        check_randomise(load_ship("frigate"), {key: width})
    with pytest.raises(ValueError, match=words):
        FrigateVectorEnv(2, randomise={"hull.mass_kg": 0.1, key: width})


def test_factors_may_reach_the_ends_of_a_range_and_stand_at_negative_numbers() -> None:
    ship = load_ship("frigate")
    check_randomise(ship, {"hull.mass_kg": 0.0, "hull.thrust_deduction": 0.99})
    check_randomise(ship, {"prime_mover.torque_offset_N_m": 0.5})  # -7381 N m
    whole = ship.with_values({"transmission.efficiency": 0.8})
    check_randomise(whole, {"transmission.efficiency": 0.25})
    with pytest.raises(ValueError, match="efficiency"):
        check_randomise(whole, {"transmission.efficiency": 0.2501})


def test_no_options_leave_all_to_the_task() -> None:
    nothing: list[dict[str, Any] | None] = [None, {}]
    for options in nothing:
        assert ResetOptions.of(options, TRANSIT, SPEEDS) == ResetOptions(
            None, None, TRANSIT.order_interval_s, None, None
        )


def test_options_become_what_an_episode_begins_with() -> None:
    begin = ResetOptions.of(
        {
            "sea": "state-5",
            "speed_order_m_s": (5, 6.5),
            "order_interval_s": 20,
            "initial_speed_m_s": 7,
            "resistance_rise": 0.1,
        },
        TRANSIT,
        SPEEDS,
    )
    assert begin.seas == read_seas("state-5", TRANSIT)
    assert begin.orders is not None
    assert begin.orders.tolist() == [5.0] + 63 * [6.5]
    assert (begin.order_interval_s, begin.initial_speed_m_s, begin.resistance_rise) == (20, 7, 0.1)
    alone = ResetOptions.of({"speed_order_m_s": 6.0}, TRANSIT, SPEEDS).orders
    assert alone is not None
    assert alone.tolist() == 64 * [6.0]
    full = ResetOptions.of({"speed_order_m_s": np.linspace(4.0, 9.0, 64)}, TRANSIT, SPEEDS).orders
    assert full is not None
    assert full.tolist() == np.linspace(4.0, 9.0, 64).tolist()


GOOD_ENDS: dict[str, tuple[Any, ...]] = {
    "speed_order_m_s": (0.0, 40.0),
    "order_interval_s": (1e-3, math.inf),
    "initial_speed_m_s": SPEEDS,
    "resistance_rise": (-0.85, 10.0),
}


@pytest.mark.parametrize("name", GOOD_ENDS)
def test_options_may_reach_the_ends_of_their_ranges(name: str) -> None:
    for end in GOOD_ENDS[name]:
        ResetOptions.of({name: end}, TRANSIT, SPEEDS)


BAD_OPTIONS: list[tuple[dict[str, Any], str]] = [
    ({"wind": 1.0}, "unknown option 'wind'; known: sea, speed_order_m_s, order_interval_s"),
    ({"sea": "state-9"}, "unknown sea 'state-9'"),
    ({"sea": []}, r"sea = \[\]"),
    ({"speed_order_m_s": -0.1}, r"speed_order_m_s = .*-0\.1.*: must be 0 to 40 m/s"),
    ({"speed_order_m_s": (5.0, 40.1)}, "speed_order_m_s = .*40.1"),
    ({"speed_order_m_s": "fast"}, "speed_order_m_s = .*fast"),
    ({"speed_order_m_s": None}, "speed_order_m_s = None"),
    ({"speed_order_m_s": math.nan}, "speed_order_m_s = .*nan"),
    ({"speed_order_m_s": []}, "speed_order_m_s: must be one order, or a list of 1 to 64"),
    (
        {"speed_order_m_s": np.full(65, 5.0)},
        "speed_order_m_s: must be one order, or a list of 1 to 64",
    ),
    ({"speed_order_m_s": [[5.0, 6.0]]}, "speed_order_m_s: must be one order, or a list of 1 to 64"),
    ({"order_interval_s": 0.0}, r"order_interval_s = 0\.0: must be 0\.001 to inf s"),
    ({"order_interval_s": None}, "order_interval_s = None"),
    ({"initial_speed_m_s": 1.0}, r"initial_speed_m_s = 1\.0: must be 4(\.434\d+)? to 10"),
    ({"initial_speed_m_s": 10.5}, r"initial_speed_m_s = 10\.5: must be 4"),
    ({"resistance_rise": -0.86}, r"resistance_rise = -0\.86: must be -0\.85 to 10 -"),
    ({"resistance_rise": 10.1}, r"resistance_rise = 10\.1"),
    ({"resistance_rise": True}, "resistance_rise = True: must be"),
    ({"resistance_rise": "1"}, "resistance_rise = '1': must be"),
    ({"resistance_rise": 1j}, "resistance_rise = 1j: must be"),
    ({"speed_order_m_s": np.array([-1])}, "speed_order_m_s = -1: must be 0 to 40 m/s"),
    ({"sea": {"hs_m": 3.0, "tp_s": 2.0}}, "sea: hs_m = 3 m at tp_s = 2 s: such waves break"),
    ({"sea": {"hs_m": 3.0}}, "sea: tp_s is missing"),
    ({"sea": {"hs_m": "high", "tp_s": 9.0}}, r"sea\['hs_m'\] = 'high': must be a number"),
]

NO_OPTIONS: list[tuple[Any, str]] = [
    ([1], r"options = \[1\]: must be a dictionary such as"),
    ("calm", "options = 'calm': must be a dictionary"),
]


@pytest.mark.parametrize(("options", "words"), BAD_OPTIONS)
def test_options_out_of_range_are_named(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        ResetOptions.of(options, TRANSIT, SPEEDS)


@pytest.mark.parametrize("form", [FrigateEnv, lambda **settings: FrigateVectorEnv(2, **settings)])
@pytest.mark.parametrize(("options", "words"), BAD_OPTIONS + NO_OPTIONS)
def test_a_refused_reset_changes_nothing(form: Any, options: Any, words: str) -> None:
    env, other = form(task="transit"), form(task="transit")
    for one in (env, other):
        one.reset(seed=1, options={"sea": "calm", "resistance_rise": 0.2})
    with pytest.raises(ValueError, match=words):
        env.reset(seed=2, options=options)
    for name, array in env.batch.arrays._asdict().items():
        assert np.array_equal(array, getattr(other.batch.arrays, name)), name
    assert np.array_equal(env.reset()[0], other.reset()[0])  # nor what is drawn next
