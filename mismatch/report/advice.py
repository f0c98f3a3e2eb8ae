"""Where an effect acts on board and what to do about it: one table by class of effect.

A class is a balance, or the keys of the ship file that begin with some words within it. The first class
that fits an effect is used. A diagnosis is evidence, not an instruction: each step is a check
before work.
"""

from __future__ import annotations

from typing import NamedTuple

from ...plant.terms import TURNING_SIGNALS
from ..search.catalogue import Effect


class Advice(NamedTuple):
    """Class of effects with its location on board and the next step."""

    balance: str  # balance in which the effects act
    keys: tuple[str, ...]  # beginnings of the key of their first parameter; empty: all
    where: str  # location on board, in words
    next_step: str  # check to do next, as a sentence


SURROUNDINGS, TURNING = "surroundings", "turning"
"""Classes of terms with external signals: of the weather, and of a ship that turns."""

_BEARINGS = "Check bearings and seals: temperature, lubrication, alignment."
_TRIM = "Compare draught and trim with those of the ship file."
_CURRENT = (
    "No work on the ship follows from a current. Compare speed over ground with speed through the "
    "water, on opposite courses if possible."
)

ADVICE = (
    Advice("hull", ("hull.current", "manoeuvring.cross_current"), "current", _CURRENT),
    Advice("hull", ("hull.episode",), "hull, for a time",
           "Find out what happened in that time: shallow water, ice, wind, a tow. The deck log has it."),
    Advice("hull", (), "hull",
           "Inspect the hull below the water line, and clean it if the inspection confirms fouling. "
           "Before that, compare draught, trim and weather of the recording with those of the ship "
           "file."),
    Advice(SURROUNDINGS, (), "wind or sea",
           "No work on the ship follows from wind or sea. Record this signal on each voyage, and "
           "compare voyages after its correction."),
    Advice(TURNING, (), "hull and rudder in turns",
           f"{_TRIM[:-1]}, and check the rudder angle indicator."),
    Advice("sway", (), "hull and rudder in turns", _TRIM),
    Advice("yaw", (), "hull and rudder in turns",
           f"{_TRIM[:-1]}, and check the rudder angle indicator."),
    Advice("propeller", ("transmission.",), "shaft line behind the torque meter", _BEARINGS),
    Advice("propeller", ("ventilation.",), "propeller near the surface",
           "Check draught aft and trim; reduce load or pitch in the waves in which it occurs."),
    Advice("propeller", ("propeller.cavitation",), "propeller",
           "Note the shaft speed at which it begins, and inspect the blades for erosion."),
    Advice("propeller", ("hull.wake", "term.wake"), "flow to the propeller",
           "Compare draught and trim with those of the ship file; check the hull before the propeller "
           "for fouling and damage."),
    Advice("propeller", (), "propeller",
           "Inspect the propeller for fouling, roughness and damage, and polish it if the inspection "
           "confirms it."),
    Advice("pitch-actuator", (), "pitch actuator",
           "Compare the pitch indicator with the mark on the hub; check zero setting, feedback and "
           "hydraulics."),
    Advice("engine", ("transmission.",), "engine side of the shaft line",
           f"{_BEARINGS} Include clutch and gearbox."),
    Advice("engine", (), "engine",
           "Check fuel quality, injection, charge air and the setting of governor and fuel rack; "
           "compare cylinder pressures and fuel flow with the shop trial."),
    Advice("motor", ("transmission.",), "motor or gear", _BEARINGS),
    Advice("motor", (), "electric drive",
           "Check supply voltage and settings of the drive, and turn the shaft by hand."),
    Advice("sensor", ("sensors.torque",), "shaft torque meter",
           "Check the zero of the torque meter with the shaft at rest, and calibrate the meter again."),
    Advice("sensor", ("sensors.thrust",), "thrust sensor",
           "Check the zero of the thrust sensor without thrust, and calibrate the sensor again."),
    Advice("sensor", ("sensors.pitch",), "pitch sensor",
           "Compare the pitch indicator with the mark on the hub, and set its zero again."),
    Advice("sensor", ("sensors.speed_log",), "speed log",
           "Compare the speed log with the speed over ground on opposite courses, and check its "
           "filter setting."),
    Advice("sensor", ("sensors.speed",), "shaft speed sensor",
           "Compare the shaft speed sensor with a second tachometer; check pulses per turn and filter."),
    Advice("sensor", ("sensors.current",), "current sensor",
           "Check the zero of the current sensor with the supply off, and calibrate the sensor again."),
    Advice("sensor", ("sensors.power",), "power meter", "Check the filter setting of the power meter."),
    Advice("sensor", (), "instrument", "Check and calibrate the instrument."),
)  # fmt: skip
"""The table. Each balance has an entry without keys, which is its last one."""


def advice_of(effect: Effect) -> Advice:
    """Return the class of an effect.

    Args:
        effect: entry of the catalogue, or an effect of the user.

    >>> from shaftline.mismatch import catalogue
    >>> effect = next(e for e in catalogue() if e.id == "torque-sensor-gain")
    >>> advice_of(effect).where
    'shaft torque meter'
    """
    key, balance = effect.parameters[0].key, effect.balance
    signals = effect.term.external_signals if effect.term is not None else ()
    if signals and balance in ("hull", "sway", "yaw"):
        own = {*TURNING_SIGNALS}
        balance = TURNING if own.issuperset(signals) else SURROUNDINGS
    return next(
        advice
        for advice in ADVICE
        if advice.balance == balance and (not advice.keys or key.startswith(advice.keys))
    )
