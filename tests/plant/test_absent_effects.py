"""An effect at its neutral value is absent to the last bit, whatever its other numbers say."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from shaftline.plant import Schedule, Ship, equilibrium, load_ship, simulate

INF = float("inf")


class Effect(NamedTuple):
    id: str
    neutral: dict[str, float]
    present: dict[str, float]
    companions: dict[str, float]  # its other numbers, which must not matter when it is absent


def effect(id: str, key: str, value: float, neutral: float = 0.0, **companions: float) -> Effect:
    section = key.split(".")[0]
    others = {f"{section}.{name}": number for name, number in companions.items()}
    return Effect(id, {key: neutral}, {key: value}, others)


PLANT_EFFECTS = [
    effect("coulomb-engine-side", "transmission.coulomb_friction_engine_side_N_m", 5e3),
    effect("viscous-engine-side", "transmission.viscous_friction_engine_side_N_m_s_rad", 500.0),
    effect(
        "arctangent-friction",
        "transmission.arctangent_friction_engine_side_N_m",
        5e3,
        arctangent_friction_slope_s_rad=0.3,
    ),
    effect("coulomb-propeller-side", "transmission.coulomb_friction_propeller_side_N_m", 5e3),
    effect("viscous-propeller-side", "transmission.viscous_friction_propeller_side_N_m_s_rad", 5e2),
    effect("quadratic-drag", "transmission.quadratic_drag_N_m_s2_rad2", 50.0),
    effect("engine-torque-lag", "prime_mover.lag_s", 1.0),
    effect(
        "smoke-limit",
        "prime_mover.charge_air_lag_s",
        4.0,
        smoke_limit_N_m=12e3,
        smoke_limit_rise_N_m=2e4,
    ),
    effect(
        "loading-limit",
        "prime_mover.warmth_lag_s",
        60.0,
        loading_limit_N_m=15e3,
        loading_limit_rise_N_m=2e4,
    ),
    effect("engine-dead-time", "prime_mover.dead_time_s", 0.6),
    effect("rack-rate-limit", "prime_mover.rack_rate_limit_mm_s", 1.0, INF),
    effect("engine-derating", "prime_mover.derating_fraction", 0.1),
    effect(
        "engine-torque-curvature",
        "prime_mover.torque_curvature_N_m_s2_rad2",
        -0.5,
        torque_curvature_speed_rad_s=60.0,
    ),
    effect(
        "resistance-exponent",
        "hull.resistance_exponent",
        2.6,
        2.0,
        resistance_reference_speed_m_s=6.0,
    ),
    effect("entrained-water-inertia", "propeller.entrained_inertia_kg_m2", 8e3),
    effect("propeller-roughness", "propeller.roughness_drag", 0.004),
    effect("inflow-lag", "propeller.inflow_lag_s", 1.0),
    effect(
        "cavitation-breakdown",
        "propeller.cavitation_breakdown",
        0.3,
        cavitation_onset_number=8.0,
        cavitation_torque_share=0.6,
    ),
    effect("wake-speed-dependence", "hull.wake_slope_s_m", 0.01, wake_reference_speed_m_s=5.0),
    effect("wave-resistance", "hull.beam_m", 14.4, bow_length_m=45.0),
    effect("hull-fouling", "hull.fouling_fraction", 0.3),
    effect("current", "hull.current_m_s", 0.7),
    effect(
        "resistance-episode",
        "hull.episode_resistance_fraction",
        0.5,
        episode_start_s=30.0,
        episode_end_s=80.0,
    ),
    effect("pitch-dead-band", "pitch_actuator.dead_band", 0.02),
    effect("pitch-backlash", "pitch_actuator.backlash", 0.03),
    effect("pitch-rate-limit", "pitch_actuator.rate_limit_per_s", 0.02, INF),
    effect("pitch-actuator-offset", "pitch_actuator.offset", 0.03),
    Effect(
        "ventilation",
        {"ventilation.thrust_loss": 0.0, "ventilation.torque_loss": 0.0},
        {"ventilation.thrust_loss": 0.6, "ventilation.torque_loss": 0.5},
        {
            "ventilation.onset_submergence": 1.7,
            "ventilation.hysteresis": 0.2,
            "ventilation.static_head_share": 0.5,
            "ventilation.suction_gain": 0.2,
            "ventilation.growth_time_s": 0.3,
            "ventilation.washout_time_s": 2.0,
        },
    ),
    effect("surface-loss", "ventilation.surface_loss", 1.0),
]

MOTOR_EFFECTS = [
    effect("command-dead-zone", "prime_mover.command_dead_zone_V", 1.5),
    effect("direction-asymmetry", "prime_mover.reverse_torque_fraction", 0.8, 1.0),
    effect("direction-asymmetry", "propeller.astern_load_fraction", 0.8, 1.0),
    effect("torque-offset", "prime_mover.torque_offset_N_m", 0.01),
    effect("open-circuit", "prime_mover.open_circuit_fraction", 0.5),
    effect("braking-loss", "prime_mover.braking_loss_fraction", 0.9),
    effect("load-friction", "transmission.load_friction_fraction", 0.1),
    effect("coulomb-asymmetry", "transmission.coulomb_asymmetry_fraction", -0.9),
    Effect(
        "viscous-asymmetry",
        {"transmission.viscous_asymmetry_fraction": 0.0},
        {
            "transmission.viscous_asymmetry_fraction": 0.9,
            "transmission.viscous_friction_engine_side_N_m_s_rad": 4e-4,
        },
        {},
    ),
    effect("command-delay", "prime_mover.command_delay_s", 0.012),
    effect("command-lag", "prime_mover.command_lag_s", 0.05),
    effect("supply-limit", "prime_mover.supply_limit_V", 5.0, INF),
    effect("supply-limit", "prime_mover.supply_current_limit_A", 1.0, INF),
    effect("supply-limit", "prime_mover.supply_soft_current_A", 1.0, INF),
]

MOTOR_SENSOR_EFFECTS = [
    effect("current-sensor-gain", "sensors.current_gain", 1.05, 1.0),
    effect("current-sensor-bias", "sensors.current_bias_A", 0.2),
    effect("current-sensor-lag", "sensors.current_lag_s", 0.1),
    effect("power-sensor-lag", "sensors.power_lag_s", 0.1),
    effect("speed-sensor-gain", "sensors.speed_gain", 0.5, 1.0),
]

SENSOR_EFFECTS = [
    effect("pitch-sensor-offset", "sensors.pitch_offset", 0.02),
    effect("torque-sensor-bias", "sensors.torque_bias_N_m", 3e3),
    effect("torque-sensor-gain", "sensors.torque_gain", 1.05, 1.0),
    effect("torque-sensor-delay", "sensors.torque_delay_s", 0.4),
    effect("speed-sensor-delay", "sensors.speed_delay_s", 0.4),
    effect("speed-sensor-lag", "sensors.speed_lag_s", 0.4),
    effect("speed-log-gain", "sensors.speed_log_gain", 1.05, 1.0),
    effect("speed-log-lag", "sensors.speed_log_lag_s", 10.0),
    effect("torque-sensor-lag", "sensors.torque_lag_s", 0.4),
    effect("speed-sensor-gain", "sensors.speed_gain", 1.02, 1.0),
    effect("thrust-sensor-gain", "sensors.thrust_gain", 0.9, 1.0),
    effect("thrust-sensor-bias", "sensors.thrust_bias_N", 2e3),
    effect("thrust-sensor-lag", "sensors.thrust_lag_s", 0.4),
    effect("current-sensor-bias", "sensors.current_bias_A", 0.2),
]

MEASURED = [
    "measured_pitch_ratio",
    "measured_shaft_speed",
    "measured_shaft_torque",
    "measured_ship_speed",
    "measured_thrust",
    "measured_motor_current",
]


def named(effects: list[Effect]) -> Any:
    return pytest.mark.parametrize("effect", effects, ids=lambda effect: effect.id)


@pytest.fixture(scope="module")
def voyage(frigate: Ship, thesis_sea: Any) -> Any:
    """A lively programme: rack and pitch step up and down in waves."""
    schedule = Schedule(
        lambda t: np.select([t < 20, t < 60, t < 90], [20.0, 28.0, 15.0], 24.0),
        lambda t: np.select([t < 40, t < 75], [1.4, 1.0], 1.25),
    )
    initial = equilibrium(frigate, 20.0, 1.4).state

    def sail(ship: Ship) -> NDArray[Any]:
        return simulate(ship, schedule, 120.0, initial=initial, sea=thesis_sea)

    return sail


@pytest.fixture(scope="module")
def nominal(frigate: Ship, voyage: Any) -> Any:
    return voyage(frigate)


@named(PLANT_EFFECTS + SENSOR_EFFECTS)
def test_neutral_value_is_absence_to_the_last_bit(
    frigate: Ship, voyage: Any, nominal: NDArray[Any], effect: Effect
) -> None:
    ship = frigate.with_values({**effect.companions, **effect.neutral})
    assert voyage(ship).tobytes() == nominal.tobytes()


@named(PLANT_EFFECTS)
def test_present_effect_changes_the_voyage(
    frigate: Ship, voyage: Any, nominal: NDArray[Any], effect: Effect
) -> None:
    changed = voyage(frigate.with_values({**effect.companions, **effect.present}))
    deviation = np.abs(changed["shaft_speed"] - nominal["shaft_speed"])
    assert np.all(np.isfinite(changed["shaft_speed"]))
    assert deviation.max() > 0.01  # rad/s


@named(SENSOR_EFFECTS)
def test_sensor_effect_changes_readings_and_nothing_else(
    frigate: Ship, voyage: Any, nominal: NDArray[Any], effect: Effect
) -> None:
    changed = voyage(frigate.with_values(effect.present))
    differing = [n for n in nominal.dtype.names or () if np.any(changed[n] != nominal[n])]
    told = set(differing) - {"shaft_power"}  # which is measured by torque and speed
    assert len(told) == 1
    assert told <= set(MEASURED)
    of_power = told <= {"measured_shaft_torque", "measured_shaft_speed"}
    assert ("shaft_power" in differing) == of_power


def tug_voyage(inductance: float) -> Any:
    """Both ways, with and without an inductance, switched off and to the end stop."""
    motor = {"prime_mover.armature_inductance_H": inductance, "propeller.model": "bollard"}
    tug = load_ship("tito-neri-sine").with_values(motor)
    schedule = Schedule(lambda t: np.select([t < 0.3, t < 0.6, t < 0.8], [4.0, 20.0, 0.0], -6.0), 1)
    initial = equilibrium(tug, 4.0, 1.0).state

    def sail(values: dict[str, float]) -> NDArray[Any]:
        return simulate(tug.with_values(values), schedule, 1.2, initial=initial)

    return sail


@pytest.mark.parametrize("inductance", [0.0, 0.000603])
@named(MOTOR_EFFECTS)
def test_motor_effect_is_absent_to_the_last_bit_or_acts(effect: Effect, inductance: float) -> None:
    sail = tug_voyage(inductance)
    nominal, changed = sail({}), sail(effect.present)
    assert sail(effect.neutral).tobytes() == nominal.tobytes()
    assert np.abs(changed["shaft_speed"] - nominal["shaft_speed"]).max() > 1.0  # rad/s


@named(MOTOR_SENSOR_EFFECTS)
def test_effect_on_a_motor_s_sensor_changes_one_reading(effect: Effect) -> None:
    sail = tug_voyage(0.0)
    nominal, changed = sail({}), sail(effect.present)
    assert sail(effect.neutral).tobytes() == nominal.tobytes()
    differing = [n for n in nominal.dtype.names or () if np.any(changed[n] != nominal[n])]
    readings = {
        "speed": ["measured_shaft_speed", "shaft_power"],  # measured torque times measured speed
        "current": ["measured_motor_current"],
        "power": ["electric_power"],
    }
    assert differing == readings[effect.id.split("-")[0]]


# optional numbers that describe the nominal ship and are no effects
NOMINAL = {
    "hull": {"fixed", "mass_kg", "resistance_coefficient_N_s2_m2", "thrust_deduction",
             "wake_fraction", "propellers"},
    "propeller": {"model", "diameter_m", "blades", "expanded_area_ratio", "pitch_ratio_min",
                  "pitch_ratio_max", "relative_rotative_efficiency", "depth_m", "thrust_coefficient",
                  "torque_coefficient", "open_water"},
    "ventilation": set(),
    "prime_mover": {"torque_limit_N_m", "torque_limit_at_min_speed_N_m",
                    "torque_limit_slope_N_m_s_rad", "starting_air_torque_N_m",
                    "fuel_base_g_kWh", "fuel_rated_power_W",
                    "fuel_p0_s1", "fuel_p0_s2", "fuel_p1_s0", "fuel_p1_s1", "fuel_p1_s2",
                    "fuel_p1_s3", "fuel_p2_s0", "fuel_p2_s1", "fuel_p2_s2", "fuel_p2_s3",
                    "fuel_p3_s0", "fuel_p3_s1", "fuel_p3_s2", "fuel_p3_s3"},
    "transmission": {"gear_ratio", "efficiency", "inertia_engine_side_kg_m2",
                     "inertia_propeller_side_kg_m2", "stiction_speed_rad_s"},
    "pitch_actuator": {"time_constant_s"},
    "sensors": set(),
    "emissions": {"nox_base_g_kWh", "nox_m0_s0", "nox_m1_s0", "nox_m0_s1", "nox_m2_s0", "nox_m1_s1",
                  "nox_m0_s2", "co2_factor"},
}  # fmt: skip


def test_every_optional_number_of_a_motor_is_nominal_or_a_covered_effect() -> None:
    fields = type(load_ship("tito-neri-sine").prime_mover).model_fields
    optional = {name for name, info in fields.items() if not info.is_required()}
    keys = [key.split(".") for one in MOTOR_EFFECTS for key in one.neutral]
    covered = {name for section, name in keys if section == "prime_mover"}
    assert optional == covered | {"armature_inductance_H"}


@pytest.mark.parametrize("section", NOMINAL)
def test_every_optional_number_is_nominal_or_a_covered_effect(frigate: Ship, section: str) -> None:
    fields = type(getattr(frigate, section)).model_fields
    optional = {name for name, info in fields.items() if not info.is_required()}
    covered = {
        key.removeprefix(f"{section}.")
        for effect in PLANT_EFFECTS + MOTOR_EFFECTS + MOTOR_SENSOR_EFFECTS + SENSOR_EFFECTS
        for key in (*effect.neutral, *effect.companions)
    }
    assert optional - NOMINAL[section] <= covered
