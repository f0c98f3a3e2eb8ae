"""Table of the effects that the independent simulator may conceal.

Each effect has one parameter that grows with its strength and shape parameters that are drawn for every
case. The ids are those of the catalogue; the forms are not. The effects in ``UNKNOWN`` are in no
catalogue.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .instruments import LIVELY

FRIGATE, BENCH = "frigate", "bench-thruster"
MOVING = ("steps", "ramps", "staircase", "harbour")
FAST = ("steps", "staircase")


@dataclass(frozen=True)
class TrueEffect:
    """Effect of the independent simulator: balance, size parameter and shape parameters."""

    id: str
    balance: str
    size: str  # parameter of its strength
    first: float  # first trial size
    most: float  # largest sensible size
    shape: dict[str, tuple[float, float]] = field(default_factory=dict)
    signs: bool = False  # either sign
    programmes: tuple[str, ...] = LIVELY
    ship: str = FRIGATE
    waves: bool = False  # visible in waves only
    window: tuple[str, str] | None = None  # parameters of its start and end, as shares
    family: str = ""  # effects that a recording may confuse

    @property
    def key(self) -> str:
        """Id with the balance, unique among the effects of a ship."""
        return f"{self.id}/{self.balance}"


_DRY = {"stribeck_rise": (0.1, 0.4), "stribeck_speed": (3.0, 5.0)}
_WET = {"wet_power": (0.9, 1.1)}
_EPISODE = {
    "episode_start": (0.15, 0.5),
    "episode_end": (0.6, 0.85),
    "episode_edge": (5.0, 25.0),
}

EFFECTS: tuple[TrueEffect, ...] = (
    TrueEffect("engine-torque-lag", "engine", "lag_time", 1.0, 10.0, {"lag_damping": (0.75, 1.1)},
           programmes=("steps", "sweep", "harbour"), family="delay"),
    TrueEffect("engine-dead-time", "engine", "dead_time", 0.5, 5.0, {"dead_time_jitter": (0.02, 0.08)},
           programmes=("steps", "sweep", "harbour"), family="delay"),
    TrueEffect("rack-rate-limit", "engine", "rack_slowness", 0.3, 5.0,
           {"rack_slowness_down": (0.75, 0.95)}, programmes=("steps", "harbour"), family="delay"),
    TrueEffect("engine-derating", "engine", "derating", 0.02, 0.4, {"derating_slope": (-0.2, 0.2)},
           family="drive loss"),
    TrueEffect("engine-torque-curvature", "engine", "bend", 0.5, 6.0,
           {"bend_speed": (65.0, 85.0), "bend_skew": (-0.2, 0.2)}, signs=True, programmes=MOVING,
           family="drive loss"),
    TrueEffect("coulomb-friction", "engine", "dry_front", 4e3, 6e4, _DRY, family="drive loss"),
    TrueEffect("viscous-friction", "engine", "wet_front", 400.0, 6e3, _WET, family="drive loss"),
    TrueEffect("coulomb-friction", "propeller", "dry_back", 4e3, 6e4, _DRY, family="load"),
    TrueEffect("viscous-friction", "propeller", "wet_back", 400.0, 6e3, _WET, family="load"),
    TrueEffect("propeller-roughness", "propeller", "section_drag", 0.002, 0.04,
           {"section_thrust": (0.15, 0.35), "section_torque": (0.2, 0.34)}, family="load"),
    TrueEffect("entrained-water-inertia", "propeller", "water_inertia", 8e3, 8e4,
           {"water_load": (-0.3, 0.3)}, programmes=("steps", "sweep", "harbour"), family="inertia"),
    TrueEffect("ventilation", "propeller", "air_torque", 0.15, 0.85,
           {"air_thrust_ratio": (1.0, 1.15), "air_submergence": (1.0, 1.35), "air_width": (0.05, 0.12),
            "air_growth": (0.3, 0.8), "air_washout": (1.0, 3.0)}, waves=True, family="air"),
    TrueEffect("inflow-lag", "propeller", "inflow_length", 30.0, 250.0, programmes=("steps", "harbour"),
           family="inflow"),
    TrueEffect("wake-speed-dependence", "propeller", "wake_change", 0.03, 0.3,
           {"wake_middle": (5.5, 8.0), "wake_width": (1.5, 3.5)}, signs=True, programmes=MOVING,
           family="inflow"),
    TrueEffect("cavitation-breakdown", "propeller", "breakdown", 0.3, 4.0,
           {"breakdown_sigma": (1.0, 1.35), "breakdown_torque": (0.5, 0.9)}, programmes=FAST,
           family="load"),
    TrueEffect("hull-fouling", "hull", "fouling", 0.05, 0.8, {"fouling_power": (1.9, 2.1)},
           family="resistance"),
    TrueEffect("resistance-episode", "hull", "episode_gain", 0.08, 1.5, _EPISODE,
           window=("episode_start", "episode_end"), family="resistance"),
    TrueEffect("current", "hull", "current", 0.2, 2.5,
           {"current_swing": (-0.3, 0.3), "current_period": (800.0, 2500.0),
            "current_phase": (0.0, 6.28)}, signs=True, family="resistance"),
    TrueEffect("pitch-dead-band", "pitch-actuator", "pitch_dead_band", 0.01, 0.15,
           {"pitch_dead_band_stop": (0.5, 0.8)}, programmes=(*MOVING, "sweep"), family="pitch"),
    TrueEffect("pitch-backlash", "pitch-actuator", "pitch_play", 0.01, 0.15,
           {"pitch_play_round": (0.1, 0.25)}, programmes=("steps", "harbour", "sweep", "ramps"),
           family="pitch"),
    TrueEffect("pitch-rate-limit", "pitch-actuator", "pitch_slowness", 20.0, 250.0,
           programmes=("steps", "harbour"), family="pitch"),
    TrueEffect("pitch-actuator-offset", "pitch-actuator", "pitch_shift", 0.01, 0.2,
           {"pitch_shift_slope": (-0.2, 0.2)}, signs=True, family="pitch"),
    TrueEffect("pitch-sensor-offset", "sensor", "pitch_reading", 0.01, 0.2,
           {"pitch_reading_slope": (-0.2, 0.2)}, signs=True, family="pitch"),
    TrueEffect("torque-sensor-bias", "sensor", "torque_zero", 3e3, 5e4,
           {"torque_zero_drift": (-0.1, 0.1)}, signs=True, family="gauge"),
    TrueEffect("torque-sensor-gain", "sensor", "torque_scale", 0.02, 0.3,
           {"torque_scale_bow": (-0.15, 0.15)}, signs=True, family="gauge"),
    TrueEffect("torque-sensor-delay", "sensor", "torque_delay", 0.5, 5.0, {"torque_filter": (0.2, 0.5)},
           programmes=("steps", "sweep", "harbour"), family="gauge"),
    TrueEffect("speed-log-gain", "sensor", "log_scale", 0.02, 0.3, {"log_scale_bow": (-0.3, 0.3)},
           signs=True, programmes=MOVING, family="resistance"),
    TrueEffect("speed-log-lag", "sensor", "log_window", 20.0, 240.0, programmes=("steps", "harbour"),
           family="log"),
    TrueEffect("command-dead-zone", "motor", "command_gap", 0.1, 4.0, {"command_gap_round": (0.1, 0.25)},
           ship=BENCH, family="motor loss"),
    TrueEffect("coulomb-friction", "motor", "dry_front", 0.02, 2.0,
           {"stribeck_rise": (0.1, 0.4), "stribeck_speed": (5.0, 15.0)}, ship=BENCH,
           family="motor loss"),
    TrueEffect("viscous-friction", "motor", "wet_front", 5e-4, 0.03, _WET, ship=BENCH,
           family="motor loss"),
    TrueEffect("quadratic-drag", "motor", "turning_drag", 1e-5, 1e-3, {"turning_power": (1.9, 2.1)},
           ship=BENCH, family="motor loss"),
    TrueEffect("direction-asymmetry", "motor", "astern_change", 0.05, 0.6, {"astern_width": (2.0, 5.0)},
           signs=True, ship=BENCH, programmes=("reversals", "sines"), family="motor load"),
    TrueEffect("supply-limit", "motor", "supply_sag", 0.05, 1.0, ship=BENCH,
           programmes=("staircase", "sines", "reversals"), family="supply"),
    TrueEffect("inflow-lag", "motor", "flow_memory", 0.4, 8.0, {"flow_share": (0.2, 0.4)}, ship=BENCH,
           programmes=("steps", "sines", "reversals"), family="inflow"),
)  # fmt: skip

UNKNOWN: tuple[TrueEffect, ...] = (
    TrueEffect("shallow-water", "hull", "shallow_rise", 0.1, 6.0, {"shallow_speed": (4.0, 5.5)},
           programmes=FAST),
    TrueEffect("warm-bearing", "engine", "bearing_heat", 4e3, 6e4, {"bearing_time": (150.0, 500.0)}),
    TrueEffect("shaft-generator", "engine", "generator_torque", 5e3, 6e4,
           {"generator_start": (0.15, 0.45), "generator_end": (0.55, 0.85)},
           window=("generator_start", "generator_end")),
    TrueEffect("fuel-limiter", "engine", "limiter_cut", 0.1, 0.8, programmes=("steps", "harbour")),
    TrueEffect("air-injection", "propeller", "bubbles", 0.04, 0.5,
           {"bubbles_period": (40.0, 90.0), "bubbles_share": (0.2, 0.4)}),
    TrueEffect("rudder-action", "hull", "rudder", 0.1, 1.5, {"rudder_period": (25.0, 60.0)}),
    TrueEffect("torsional-order", "propeller", "order_torque", 3e3, 6e4, {"order_ratio": (0.1, 0.2)}),
    TrueEffect("winding-heat", "motor", "winding_heat", 0.1, 3.0, {"winding_time": (60.0, 200.0)},
           ship=BENCH),
    TrueEffect("cogging", "motor", "cogging", 0.02, 2.0, ship=BENCH),
)  # fmt: skip

CONFOUNDED = (
    "engine-derating/engine",
    "engine-torque-curvature/engine",
    "coulomb-friction/engine",
    "viscous-friction/engine",
    "coulomb-friction/propeller",
    "viscous-friction/propeller",
    "propeller-roughness/propeller",
    "wake-speed-dependence/propeller",
    "hull-fouling/hull",
    "current/hull",
    "pitch-actuator-offset/pitch-actuator",
    "pitch-sensor-offset/sensor",
    "torque-sensor-bias/sensor",
    "torque-sensor-gain/sensor",
)
"""Effects that are visible but not distinguishable in a nearly steady cruise."""

BY_KEY = {effect.key: effect for effect in (*EFFECTS, *UNKNOWN)}


def families(ship: str, name: str) -> set[str]:
    """Return the families of an id on a ship."""
    return {e.family for e in EFFECTS if (e.ship, e.id) == (ship, name)}
