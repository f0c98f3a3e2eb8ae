"""Recordings with the pitch that was reached, but without its command.

Logs of ships in service often have the feedback of the pitch alone. The measured pitch then takes the
place of the command, and the ship that is compared has a pitch actuator without a noticeable lag.
Nothing can be said about the actuator itself.
"""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from ...plant.ship import Ship

PITCH, PITCH_COMMAND = "pitch_ratio", "pitch_ratio_command"

ACTUATOR = "pitch_actuator.time_constant_s"

NOT_OF_THE_COMMAND = ("pitch-dead-band", "pitch-rate-limit", "pitch-backlash")
"""Effects of the catalogue that the measured pitch has passed already. A backlash acts behind it, but in
a simulation it would remove the noise of the sensor, and would be found for that reason."""

MEASURED_PITCH = (
    f"the recording has no {PITCH_COMMAND}: the measured {PITCH} takes its place, and the pitch "
    "actuator is not diagnosed"
)

_LAG = 0.25
"""Time constant of the actuator as a share of the interval between rows: shorter than the rows show."""


def use_measured_pitch(table: pd.DataFrame, ship: Ship) -> pd.DataFrame:
    """Return a table in canonical columns, in which a measured pitch stands for a missing command."""
    if not ship.has_variable_pitch or PITCH_COMMAND in table or PITCH not in table:
        return table
    given = table.rename(columns={PITCH: PITCH_COMMAND})
    given.attrs = table.attrs | {"measured_pitch": True}
    return given


def follow_measured_pitch(ship: Ship, interval_s: float) -> Ship:
    """Return the ship with a pitch actuator whose lag is shorter than the rows show.

    The actuator has no dead band, no rate limit and no tolerance: the measured pitch has passed them.

    Args:
        ship: the ship.
        interval_s: interval between the rows of the recording [s].
    """
    own, known = ship.pitch_actuator, ship.tolerances
    least = max(_LAG * interval_s, ship.time_step_s, 0.05)
    actuator = own.model_copy(
        update={
            "time_constant_s": min(own.time_constant_s, least),
            "dead_band": 0.0,
            "rate_limit_per_s": float("inf"),
        }
    )
    numbers = {key: value for key, value in known.numbers.items() if key != ACTUATOR}
    correlations = {
        first: {key: value for key, value in others.items() if key != ACTUATOR}
        for first, others in known.correlations.items()
        if first != ACTUATOR and {*others} != {ACTUATOR}
    }
    tolerances = known.model_copy(
        update={"pitch_time_constant": 0.0, "numbers": numbers, "correlations": correlations}
    )
    return ship.model_copy(update={"pitch_actuator": actuator, "tolerances": tolerances})


def refuse_free_actuator(keys: Iterable[str]) -> None:
    """Refuse parameters between the command and the measured pitch, which cannot be estimated.

    Raises:
        ValueError: gives the key and what the recording needs.
    """
    for key in keys:
        if key in (ACTUATOR, "pitch_actuator.dead_band", "pitch_actuator.rate_limit_per_s"):
            raise ValueError(
                f"{key} cannot be estimated: the recording has no {PITCH_COMMAND}, only the measured "
                f"{PITCH}; record the command as well"
            )


def restore_pitch_actuator(corrected: Ship, file: Ship) -> Ship:
    """Return a ship of :func:`follow_measured_pitch`, corrected by effects, with its file's actuator.

    An offset acts behind the measured pitch and stays as it was found.
    """
    actuator = file.pitch_actuator.model_copy(update={"offset": corrected.pitch_actuator.offset})
    before, after = file.tolerances, corrected.tolerances
    own = {key: value for key, value in before.numbers.items() if key == ACTUATOR}
    share, numbers = before.pitch_time_constant, after.numbers | own
    tolerances = after.model_copy(update={"pitch_time_constant": share, "numbers": numbers})
    if numbers == before.numbers:  # The correlations with the actuator still hold as well.
        tolerances = before
    return corrected.model_copy(update={"pitch_actuator": actuator, "tolerances": tolerances})
