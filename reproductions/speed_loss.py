"""Score the speed loss of generated logs that conceal fouling; write ``speed-loss.md``."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
import pandas as pd

from shaftline.performance import ReferenceShip, analyse_performance
from shaftline.performance.monitoring import COLUMNS, DAY_S, step_between
from shaftline.performance.tables import canonical
from shaftline.plant.surroundings import KNOT

from .pages import make_parser
from .writing import write_results

TITLE = "Speed loss of generated logs with concealed cleanings"

EXPONENT, DAYS = 3.3, 730
SPEEDS = np.arange(7.0, 18.0)
ANGLES, DRAG = [0, 30, 60, 90, 120, 150, 180], [0.8, 0.9, 0.5, 0.1, -0.3, -0.6, -0.6]
SHIP = ReferenceShip.model_validate(
    {
        "name": "bulk carrier",
        "beam_m": 32.0,
        "draught_m": 10.0,
        "speed_kn": SPEEDS.tolist(),
        "power_kW": (6000.0 * (SPEEDS / 12.0) ** EXPONENT).tolist(),
        "superstructure": {"frontal_area_m2": 600.0, "angle_deg": ANGLES, "coefficient": DRAG},
    }
)


class Truth(NamedTuple):
    """What a generated log conceals."""

    rate: float
    """Rise of the power by fouling, as a share a year."""
    cleanings: tuple[tuple[float, float], ...]
    """Day of each cleaning, and the speed that it gave back [%]."""


def make_log(seed: int, hours: float, noise: float) -> tuple[pd.DataFrame, Truth]:
    """Return a log of two years and what it conceals.

    Speed in cycles of a voyage, Rayleigh wind from all sides, shallow water in a tenth of the rows,
    none to two cleanings at least 100 days apart, each of which removes 30 to 100 % of the fouling.

    Args:
        seed: of all random numbers.
        hours: interval of the rows.
        noise: relative standard deviation of the power; the speed has 1 %.
    """
    generator = np.random.default_rng(seed)
    day = np.arange(int(DAYS * 24 / hours)) * hours / 24.0
    count = len(day)
    phase = generator.uniform(0.0, 6.0)
    speed = (
        12.5 + 1.5 * np.sin(2.0 * np.pi * day / 17.0 + phase) + generator.normal(0.0, 0.7, count)
    )
    speed = np.clip(speed, 8.0, 16.0)
    events = np.sort(generator.choice(np.arange(120, DAYS - 120), generator.integers(0, 3), False))
    if len(events) == 2 and events[1] - events[0] < 100:
        events = events[:1]
    rate, level = generator.uniform(0.04, 0.16), generator.uniform(0.0, 0.03)
    fouling, cleanings, start = np.zeros(count), [], 0.0
    for end in (*events.astype(float), np.inf):
        rows = (day >= start) & (day < end)
        fouling[rows] = level + rate * (day[rows] - start) / 365.25
        if end < np.inf:
            before = fouling[rows][-1]
            level = before * (1.0 - generator.uniform(0.3, 1.0))
            gain = (1.0 + level) ** (-1.0 / EXPONENT) - (1.0 + before) ** (-1.0 / EXPONENT)
            cleanings.append((float(end), 100.0 * gain))
        start = end
    wind, angle = generator.rayleigh(4.5, count), generator.uniform(-np.pi, np.pi, count)
    own = speed * KNOT
    seen = np.hypot(own + wind * np.cos(angle), wind * np.sin(angle))
    from_bow = np.degrees(np.arctan2(wind * np.sin(angle), own + wind * np.cos(angle)))
    drag = np.interp(np.abs(from_bow), ANGLES, DRAG)
    blown = 0.5 * 1.225 * 600.0 * (drag * seen**2 - DRAG[0] * own**2) * own / 0.7 / 1e3
    power = 6000.0 * (speed / 12.0) ** EXPONENT * (1.0 + fouling) + blown
    table = pd.DataFrame(
        {
            "time_d": day,
            "stw_kn": speed * np.exp(0.01 * generator.standard_normal(count)),
            "power_kW": power * np.exp(noise * generator.standard_normal(count)),
            "wind_speed_m/s": seen,
            "wind_angle_deg": from_bow,
            "depth_m": generator.choice([15.0, 200.0, 4000.0], count, p=[0.1, 0.2, 0.7]),
        }
    )
    return table, Truth(rate, tuple(cleanings))


NEAR_DAYS = 15.0
"""Largest distance of a found event from a cleaning that it counts as."""

KINDS = tuple(itertools.product((1.0, 24.0), (0.03, 0.06)))
"""Interval of the rows [h] and noise of the power."""


def score(count: int, seed: int) -> pd.DataFrame:
    """Return a row for each kind of log: cleanings, found, false events, errors, coverage.

    Args:
        count: logs of each kind.
        seed: of the first log.
    """
    rows = []
    for k, (hours, noise) in enumerate(KINDS):
        cleanings = found = false = covered = periods = 0
        distances, errors, missed = [], [], []
        for log in range(count):
            table, truth = make_log(seed + k * count + log, hours, noise)
            report = analyse_performance(SHIP, canonical(table, COLUMNS, "log"))
            steps = [step_between(a, b)[0] for a, b in itertools.pairwise(report.periods)]
            events = [period.start_s / DAY_S for period in report.periods[1:]]
            matched = set()
            for day, gain in truth.cleanings:
                cleanings += 1
                near = [e for e in range(len(events)) if abs(events[e] - day) < NEAR_DAYS]
                if not near:
                    missed.append(gain)
                    continue
                best = min(near, key=lambda e: abs(events[e] - day))
                matched.add(best)
                found += 1
                distances.append(abs(events[best] - day))
                errors.append(steps[best] - gain)
            false += len(events) - len(matched)
            if len(events) == len(matched) == len(truth.cleanings):
                for period in report.periods:
                    periods += 1
                    slope = -100.0 * truth.rate / EXPONENT * (1.0 + truth.rate / 2.0) ** (-1.3)
                    covered += abs(period.slope - slope) < period.slope_half + 0.1 * abs(slope)
        rows.append(
            (
                f"{hours:g}",
                f"{100 * noise:g}",
                count,
                cleanings,
                found,
                false,
                float(np.mean(distances)) if distances else np.nan,
                float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan,
                max(missed, default=np.nan),
                100.0 * covered / periods if periods else np.nan,
            )
        )
    return pd.DataFrame(
        rows,
        columns=[
            "rows every [h]",
            "power noise [%]",
            "logs",
            "cleanings",
            "found",
            "false events",
            "error of the day, mean",
            "error of the step, rms [%]",
            "largest missed step [%]",
            "trend within its interval [%]",
        ],
    )


def main(arguments: list[str] | None = None) -> None:
    """Write the page."""
    parser = make_parser("speed_loss", __doc__, "out/speed-loss")
    parser.add_argument("--logs", type=int, default=24, help="logs of each kind")
    parser.add_argument("--seed", type=int, default=7000, help="seed of the first log")
    options = parser.parse_args(arguments)
    table = score(options.logs, options.seed)
    command = f"--logs {options.logs} --seed {options.seed}"
    write_results(__file__, options.out, TITLE, table, {}, command, table=table)
