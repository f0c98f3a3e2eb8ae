"""Every entry of the catalogue: conceal it in a voyage, find it again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.mismatch import Diagnosis, catalogue, diagnose
from shaftline.mismatch.report.html import report_html
from shaftline.mismatch.search.catalogue import applicable_effects, confusable_ids, parse_entries
from shaftline.plant import Ship, load_ship
from shaftline.plant.expressions import MAX_TERMS
from shaftline.plant.replay import simulate_recording
from shaftline.plant.terms import Term

from ..voyages import bench_tug, frigate_voyage, quick_frigate, tug_run

ENGINE_SIDE = "transmission.coulomb_friction_engine_side_N_m"

ON_THE_FRIGATE: list[tuple[str, str, dict[str, Any]]] = [
    ("engine-torque-lag", "engine", {"prime_mover.lag_s": 1.5}),
    ("engine-dead-time", "engine", {"prime_mover.dead_time_s": 0.8}),
    ("rack-rate-limit", "engine", {"prime_mover.rack_rate_limit_mm_s": 0.6}),
    ("engine-derating", "engine", {"prime_mover.derating_fraction": 0.08}),
    (
        "engine-torque-curvature",
        "engine",
        {
            "prime_mover.torque_curvature_N_m_s2_rad2": -1.5,
            "prime_mover.torque_curvature_speed_rad_s": 70.0,
        },
    ),
    ("coulomb-friction", "engine", {ENGINE_SIDE: 12000.0}),
    ("viscous-friction", "engine", {"transmission.viscous_friction_engine_side_N_m_s_rad": 1500.0}),
    ("coulomb-friction", "propeller", {"transmission.coulomb_friction_propeller_side_N_m": 9000.0}),
    (
        "viscous-friction",
        "propeller",
        {"transmission.viscous_friction_propeller_side_N_m_s_rad": 1200.0},
    ),
    ("propeller-roughness", "propeller", {"propeller.roughness_drag": 0.003}),
    ("entrained-water-inertia", "propeller", {"propeller.entrained_inertia_kg_m2": 8000.0}),
    (
        "wake-speed-dependence",
        "propeller",
        {"hull.wake_slope_s_m": 0.02, "hull.wake_reference_speed_m_s": 8.0},
    ),
    (
        "cavitation-breakdown",
        "propeller",
        {"propeller.cavitation_breakdown": 0.5, "propeller.cavitation_onset_number": 3.5},
    ),
    ("hull-fouling", "hull", {"hull.fouling_fraction": 0.2}),
    (
        "resistance-episode",
        "hull",
        {
            "hull.episode_resistance_fraction": 0.5,
            "hull.episode_start_s": 180.0,
            "hull.episode_end_s": 330.0,
        },
    ),
    ("current", "hull", {"hull.current_m_s": 0.6}),
    ("pitch-dead-band", "pitch-actuator", {"pitch_actuator.dead_band": 0.02}),
    ("pitch-backlash", "pitch-actuator", {"pitch_actuator.backlash": 0.03}),
    ("pitch-rate-limit", "pitch-actuator", {"pitch_actuator.rate_limit_per_s": 0.02}),
    ("pitch-actuator-offset", "pitch-actuator", {"pitch_actuator.offset": 0.03}),
    ("pitch-sensor-offset", "sensor", {"sensors.pitch_offset": 0.03}),
    ("torque-sensor-bias", "sensor", {"sensors.torque_bias_N_m": -9000.0}),
    ("torque-sensor-gain", "sensor", {"sensors.torque_gain": 0.93}),
    ("torque-sensor-delay", "sensor", {"sensors.torque_delay_s": 0.8}),
    ("speed-sensor-delay", "sensor", {"sensors.speed_delay_s": 0.6}),
    ("speed-log-gain", "sensor", {"sensors.speed_log_gain": 1.04}),
    ("speed-log-lag", "sensor", {"sensors.speed_log_lag_s": 15.0}),
]

LONG = ("engine-torque-curvature", "wake-speed-dependence", "cavitation-breakdown")
"""Effects that show at the ends of the ship's speeds, which takes the whole voyage."""

ON_THE_TUG: list[tuple[str, dict[str, Any]]] = [
    ("command-dead-zone", {"prime_mover.command_dead_zone_V": 0.4}),
    ("coulomb-friction", {ENGINE_SIDE: 0.07}),  # the tug's own is 0.051
    ("viscous-friction", {"transmission.viscous_friction_engine_side_N_m_s_rad": 4e-4}),
    ("quadratic-drag", {"transmission.quadratic_drag_N_m_s2_rad2": 8e-6}),
    ("torque-offset", {"prime_mover.torque_offset_N_m": 0.02}),
    ("direction-asymmetry", {"prime_mover.reverse_torque_fraction": 0.8}),
    ("direction-asymmetry", {"propeller.astern_load_fraction": 0.3}),
    ("load-friction", {"transmission.load_friction_fraction": 0.15}),
    ("supply-limit", {"prime_mover.supply_limit_V": 6.5}),
    ("supply-limit", {"prime_mover.supply_current_limit_A": 1.0}),
    ("supply-limit", {"prime_mover.supply_soft_current_A": 2.0}),
]


@pytest.fixture(autouse=True)
def one_round(monkeypatch: pytest.MonkeyPatch) -> None:
    """One effect is concealed and one looked for; that no second is invented is the pipeline's test."""
    monkeypatch.setattr("shaftline.mismatch.search.selection.MOST_EFFECTS", 1)


def _named(diagnosis: Diagnosis, effect: str, balance: str) -> None:
    confirmed = diagnosis.corrected != diagnosis.ship  # on the held-out data
    assert diagnosis.verdict == ("explained" if confirmed else "partly-explained")
    first = diagnosis.findings[0]
    names = {first.effect.id, *(c.effect.id for c in first.rivals)}
    assert effect in names
    if first.effect.id == effect:
        assert first.effect.balance == balance


@pytest.mark.parametrize(
    ("effect", "balance", "values"), ON_THE_FRIGATE, ids=[f"{e}-{b}" for e, b, _ in ON_THE_FRIGATE]
)
def test_a_concealed_effect_is_named(effect: str, balance: str, values: dict[str, Any]) -> None:
    seconds = 600.0 if effect in LONG else 300.0
    true = quick_frigate().with_values(values)
    found = diagnose(quick_frigate(), frigate_voyage(true, seed=3, seconds=seconds))
    _named(found, effect, balance)
    first = found.findings[0]
    if first.effect.id == effect:
        true = next(iter(values.values()))
        assert first.estimates[0].value == pytest.approx(true, rel=0.15)
    # open loop on data never fitted, no channel becomes worse than noise allows
    for column, before in found.fit_before.items():
        assert found.fit_after[column] > before - 0.5


@pytest.mark.parametrize(("effect", "values"), ON_THE_TUG, ids=[e for e, _ in ON_THE_TUG])
def test_a_motor_s_concealed_effect_is_named(effect: str, values: dict[str, Any]) -> None:
    _named(diagnose(bench_tug(), tug_run(values, seed=1)), effect, "motor")


def test_a_lag_of_the_speed_sensor_is_named_where_the_torque_is_measured() -> None:
    """A delay as long does as well, within what the rows can tell."""
    _named(
        diagnose(bench_tug(), tug_run({"sensors.speed_lag_s": 0.3}, seed=1)),
        "speed-sensor-lag",
        "sensor",
    )


def test_ventilation_is_named_where_the_submergence_was_measured() -> None:
    def submergence(t: Any) -> Any:
        return 3.2 - 1.6 * np.sin(2 * np.pi * t / 11.0) * (np.sin(2 * np.pi * t / 97.0) > 0)

    values = {
        "ventilation.torque_loss": 0.4,
        "ventilation.thrust_loss": 0.46,
        "ventilation.onset_submergence": 1.1,
        "ventilation.suction_gain": 0.0,
        "ventilation.static_head_share": 0.0,
    }
    extra = {"propeller_submergence_m": submergence}
    true = quick_frigate().with_values(values)
    table = frigate_voyage(true, seed=3, seconds=300.0, extra=extra)
    found = diagnose(quick_frigate(), table)
    _named(found, "ventilation", "propeller")
    sizes = [estimate.value for estimate in found.findings[0].estimates]
    assert sizes == pytest.approx([0.4, 1.1], rel=0.1)


def test_an_inflow_lag_is_named_where_the_inflow_was_measured() -> None:
    def gusts(t: Any) -> Any:
        return 0.8 * np.sin(2 * np.pi * t / 7.0) + 0.5 * np.sin(2 * np.pi * t / 23.0)

    values = {"propeller.inflow_lag_s": 2.5}
    true = quick_frigate().with_values(values)
    table = frigate_voyage(true, seed=3, seconds=300.0, extra={"inflow_velocity_m_s": gusts})
    found = diagnose(quick_frigate(), table)
    _named(found, "inflow-lag", "propeller")
    assert found.findings[0].estimates[0].value == pytest.approx(2.5, rel=0.1)


def test_entries_cannot_change_and_serve_as_keys() -> None:
    assert len({effect: effect.id for effect in catalogue()}) == len(catalogue())


def test_entries_say_what_an_engineer_must_know() -> None:
    ids = {effect.id for effect in catalogue()}
    for effect in catalogue():
        assert effect.equation
        assert effect.latex
        assert effect.lacks
        assert effect.excitation
        assert set(effect.confused_with) <= ids
        assert bool(effect.split_by) or not effect.confused_with


def test_only_what_a_ship_can_have_is_tried() -> None:
    frigate = {e.label for e in applicable_effects(load_ship("frigate"), ["shaft_torque_N_m"])}
    assert "command-dead-zone (motor)" not in frigate
    assert "ventilation (propeller)" not in frigate  # asks for the submergence
    tug = {e.label for e in applicable_effects(bench_tug(), ["shaft_speed_rad_s"])}
    assert "engine-derating (engine)" not in tug
    assert "hull-fouling (hull)" not in tug
    with pytest.raises(ValueError, match="unknown effect 'rust'"):
        applicable_effects(load_ship("frigate"), [], ["rust"])


def test_a_drive_without_a_propeller_is_offered_nothing_of_one(servo: Ship) -> None:
    everything = {"shaft_torque_N_m", "thrust_N", "propeller_submergence_m", "ship_speed_m_s"}
    found = {e.label: e for e in applicable_effects(servo, everything)}
    assert set(found) == {
        "torque-sensor-bias (sensor)",
        "torque-sensor-gain (sensor)",
        "torque-sensor-delay (sensor)",
        "coulomb-friction (motor)",
        "viscous-friction (motor)",
        "quadratic-drag (motor)",
        "coulomb-friction (motor, stribeck)",
        "torque-offset (motor)",
        "load-friction (motor)",
        "torque-sensor-lag (sensor)",
        "command-curve (motor)",
        "command-delay (motor, torque)",
        "command-lag (motor, torque)",
    }
    assert not any("propeller" in said for e in found.values() for said in (e.lacks, e.equation))
    drag = found["quadratic-drag (motor)"]
    assert confusable_ids(drag, servo) == ("viscous-friction",)
    assert confusable_ids(drag, bench_tug()) == drag.confused_with


def test_a_shaft_whose_speed_is_held_has_friction_behind_its_gauge(held_frigate: Ship) -> None:
    found = {
        e.label for e in applicable_effects(held_frigate, ["shaft_torque_N_m", "ship_speed_m_s"])
    }
    assert {"coulomb-friction (propeller)", "propeller-roughness (propeller)"} <= found
    assert not any("(engine" in label or "(motor" in label for label in found)
    assert not any(
        "behind" in e.equation for e in applicable_effects(bench_tug(), ["shaft_torque_N_m"])
    )


def servo_run(ship: Ship, seed: int = 0) -> pd.DataFrame:
    """A servo's torque stepped in both directions."""
    rng = np.random.default_rng(seed)
    rows = 3000
    torque = np.repeat(rng.uniform(-90.0, 90.0, rows // 50), 50)
    table = pd.DataFrame(
        {"time_s": 0.01 * np.arange(rows), "motor_torque_N_m": torque, "shaft_speed_rad_s": 0.0}
    )
    run = simulate_recording(ship, table)[list(table)]
    run["shaft_speed_rad_s"] += 1e-3 * rng.standard_normal(rows)
    return run


def test_friction_of_a_drive_is_found(servo: Ship) -> None:
    """What is probed is scaled by the drive's torque, for there is no propeller's."""
    found = diagnose(servo, servo_run(servo.with_values({ENGINE_SIDE: 8.0})))
    _named(found, "coulomb-friction", "motor")
    (estimate,) = found.findings[0].estimates
    assert estimate.value == pytest.approx(8.0, rel=0.05)
    told = report_html(found).split('<p class="note">Not tried')[0]
    assert "coulomb friction" in told
    assert "ropeller" not in told


def simulated(ship: Ship) -> Any:
    return simulate_recording(ship, frigate_voyage(seed=1, seconds=60.0))


WAVE_MAKING = """
[[term]]
id = "wave-making"
balance = "hull"
acts_on = "resistance"
expression = "c4 * ship_speed ** 4"
equation = "R -> R + c4 v^4"
latex = 'R \\to R + c_4 v^4'
lacks = "force that grows with the fourth power of speed: the ship makes waves"
excitation = "several ship speeds"
[term.parameters]
c4 = { unit = "N s4/m4", low = 0.0, high = 1e4, probes = [0.5, 2.0, 8.0] }
"""


def test_an_entry_may_be_a_term(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Physics that no code knows: the entry alone, concealed in a voyage and found again."""
    (own,) = parse_entries(WAVE_MAKING)
    assert not own.parameters[0].signed  # what is left out
    frigate = load_ship("frigate")
    assert own.on(own.on(frigate)) == own.on(frigate)
    assert simulated(own.on(frigate)).equals(simulated(frigate))
    truth = own.on(frigate).with_values({"term.wave-making-hull.c4": 6.0})
    everything = (*catalogue(), own)
    monkeypatch.setattr("shaftline.mismatch.search.catalogue.catalogue", lambda: everything)
    found = diagnose(frigate, frigate_voyage(truth, seed=5, seconds=300.0))
    _named(found, "wave-making", "hull")
    (estimate,) = found.findings[0].estimates
    assert (estimate.key, estimate.unit) == ("term.wave-making-hull.c4", "N s4/m4")
    assert estimate.value == pytest.approx(6.0, rel=0.1)
    low, high = estimate.ci95
    assert low < 6.0 < high
    found.save(tmp_path)
    corrected = load_ship(tmp_path / "corrected_ship.toml")
    assert corrected.parameter(estimate.key).value == pytest.approx(estimate.value)


def test_a_ship_full_of_terms_is_offered_no_more() -> None:
    (own,) = parse_entries(WAVE_MAKING)
    ship = load_ship("frigate")
    for i in range(MAX_TERMS):
        assert own.acts_on(ship)
        ship = ship.with_term(Term(id=f"t{i}", acts_on="thrust", expression="1"))
    assert not own.acts_on(ship)
    assert not own.acts_on(load_ship("rov-thruster"))  # no hull that moves
