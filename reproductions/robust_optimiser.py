"""Compare the CPP optimiser with robust ones under wrong KQ, relative rotative efficiency and wake.

Run ``python -m reproductions robust_optimiser --out docs/results``; about four minutes on one core.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from numpy.typing import NDArray

from shaftline.agents.evaluation.statistics import mean_with_interval
from shaftline.baselines import combinator_curve
from shaftline.baselines.combinator_surface import look_up
from shaftline.baselines.cpp_optimiser import TRIM_SHARE, CppOptimiser
from shaftline.baselines.steady_points import SteadyPoint, steady_point
from shaftline.baselines.working_point import surface
from shaftline.core.statistics import wilson_interval
from shaftline.observers.torque_curve import velocity_from_torque
from shaftline.plant import Ship, load_ship
from shaftline.plant.hull import wake_inflow
from shaftline.plant.open_water import REVOLUTIONS_PER_RADIAN
from shaftline.plant.particulars import Particulars, ship_from_particulars
from shaftline.plant.shaft import drive_torque

from .anti_spin_ships import PARTICULARS
from .pages import make_parser, print_dot
from .writing import write_results

ETA_R, WAKE = "propeller.relative_rotative_efficiency", "hull.wake_fraction"
BOUNDS = (0.05, 0.03, 0.04)
"""Largest errors of KQ [-] and eta_R [-], relative, and of the wake fraction [-]."""

FIRST_SEED = 5000
RISE = 1.15  # resistance over that in calm water, as in the experiment of the source paper [-]
ORDERS = {"cruise": 0.75, "full": 1.0}
"""Ordered speeds as shares of the highest speed of the combinator in calm water."""

SHIPS = ("frigate", "ferry", "trawler")
NOMINAL, WORST, EXPECTED = "nominal", "worst case", "expected"
BY_WAKE, BY_TORQUE = "nominal wake", "shaft torque"
ESTIMATES = (BY_WAKE, BY_TORQUE)
"""Advance velocity that the optimiser uses: speed log and wake fraction of the ship file, or shaft
torque and KQ of the ship file, as an observer in a steady state."""

ENDS = ("", "_low", "_high")  # of an estimate and its 95 % interval
_LEAST_SAVING = 1e-5  # relative change of the fuel above which a version saves fuel [-]


class Errors(NamedTuple):
    """Errors of a ship file: those of the true ship relative to it."""

    kq: float = 0.0  # relative [-]
    eta_r: float = 0.0  # relative [-]
    wake: float = 0.0  # of the wake fraction [-]

    def true_ship(self, ship: Ship) -> Ship:
        """Return the ship whose parameters differ by these errors; KQ acts like 1 / eta_R."""
        plant = ship.record()
        efficiency = float(plant["relative_rotative_efficiency"]) * (1.0 + self.eta_r)
        wake = float(plant["wake_fraction"]) + self.wake
        return ship.with_values({ETA_R: efficiency / (1.0 + self.kq), WAKE: wake})


def draw_errors(count: int, first_seed: int = FIRST_SEED) -> list[Errors]:
    """Return independent errors, uniform within the bounds, one for each seed."""
    seeds = range(first_seed, first_seed + count)
    draws = [np.random.default_rng(seed).uniform(-1.0, 1.0, 3) for seed in seeds]
    return [Errors(*(float(x) for x in BOUNDS * draw)) for draw in draws]


def get_ship(name: str) -> Ship:
    """Return a ship of the package, or one from particulars."""
    if name in PARTICULARS:
        return ship_from_particulars(Particulars(name=name, **PARTICULARS[name]))
    return load_ship(name)


def make_optimiser(ship: Ship, version: str, estimate: str) -> CppOptimiser:
    """Return a version of the optimiser, without an error of the wake if torque gives the estimate."""
    own: dict[str, Any] = {"va_weight": 0.0} if estimate == BY_WAKE else {}
    if version != NOMINAL:
        kq, eta_r, wake = BOUNDS
        own |= {"kq_error": kq, "eta_r_error": eta_r, "expected": float(version == EXPECTED)}
        own |= {"wake_error": wake} if estimate == BY_WAKE else {}
    return CppOptimiser(ship, **own)


class SettledState(NamedTuple):
    """Steady state of a ship under an optimiser."""

    point: SteadyPoint
    estimate: float  # advance velocity that the optimiser uses [m/s]
    estimated_thrust: float  # of one propeller [N]
    set_thrust: float  # set-point: the ordered thrust, at most the highest of the surface [N]
    ordered_thrust: float  # thrust for the ordered speed in calm water, by the ship file [N]
    demanded_share: float  # engine torque that the set-points take, over its limit [-]

    @property
    def fuel_per_mile(self) -> float:
        """Fuel per nautical mile [kg]."""
        return 1852.0 * self.point.fuel_flow / self.point.ship_speed

    @property
    def shortfall(self) -> float:
        """Share of the ordered thrust that the propeller does not give [-]."""
        return max(1.0 - self.point.thrust / self.ordered_thrust, 0.0)


def settle(
    actual: Ship, optimiser: CppOptimiser, estimate: str, order: float, factor: float = RISE
) -> SettledState:
    """Return the steady state at which an optimiser stays, on a ship that differs from its ship file.

    The thrust controller has trimmed the shaft speed until the estimated thrust equals the set-point, or
    to the end of its trim or the highest speed of the engine. Where that takes more than the engine's
    torque limit, the shaft turns as fast as the limit allows.

    Args:
        actual: true ship.
        optimiser: its ship file is that of the design.
        estimate: one of :data:`ESTIMATES`.
        order: ordered ship speed [m/s].
        factor: resistance factor d_c1 [-].

    Raises:
        RuntimeError: no steady state exists, or the ordered thrust is below the surface, where the
            combinator takes over.
    """
    ship, model, plant = optimiser.ship, optimiser.plant, actual.record()
    diameter, table = ship.propeller.diameter_m, optimiser.surface
    force = ship.water.density_kg_m3 * diameter**4
    ordered = optimiser.ordered_thrust(order)
    low, top = ship.shaft_speeds
    pitches = ship.propeller.pitch_ratio_min, ship.propeller.pitch_ratio_max

    def seen(speed: float, pitch: float) -> tuple[SteadyPoint, float, float, Any]:
        point = steady_point(actual, speed, pitch, factor)
        velocity = float(wake_inflow(model, point.ship_speed))
        if estimate == BY_TORQUE:
            read = float(drive_torque(plant, point.brake_torque, speed))
            velocity, _ = velocity_from_torque(model, read, speed, pitch, point.advance_velocity)
        n = speed * REVOLUTIONS_PER_RADIAN
        j = min(max(velocity / (n * diameter), 0.0), pitch)
        thrust = float(surface(optimiser.fit.thrust, j, pitch)) * force * n * n
        return point, velocity, thrust, look_up(table, ordered, np.array([velocity]))

    def solve(lacking: Callable[[Any, float], float], start: NDArray[np.float64]) -> Any:
        """Return the settings (omega, P/D) on the surface at which ``lacking`` is 0."""

        def off(x: NDArray[np.float64]) -> list[float]:
            speed = float(np.clip(x[0] * top, 0.5 * low, 2.0 * top))
            pitch = float(np.clip(x[1], *pitches))
            found = seen(speed, pitch)
            return [lacking(found, speed), x[1] - float(found[3].pitch_ratio[0])]

        found = scipy.optimize.root(off, start, tol=1e-9)
        if not found.success and max(map(abs, off(found.x))) > 1e-5:
            raise RuntimeError(f"{ship.name}: no steady state at {order:g} m/s: {found.message}")
        return found.x

    first = look_up(table, ordered, np.atleast_1d(wake_inflow(model, order)))
    start = np.array([float(first.shaft_speed[0]) / top, float(first.pitch_ratio[0])])
    x = solve(lambda found, _: found[2] / float(found[3].thrust[0]) - 1.0, start)

    def beyond(found: Any, speed: float) -> float:
        """Return the excess of a shaft speed over the end of the trim and the highest speed [-]."""
        trimmed = float(found[3].shaft_speed[0]) + TRIM_SHARE * top
        return speed / min(trimmed, top) - 1.0

    if beyond(seen(float(x[0] * top), float(x[1])), float(x[0] * top)) > 1e-9:
        x = solve(beyond, x)
    point, velocity, thrust, setting = seen(float(x[0] * top), float(x[1]))
    demanded = point.torque_share
    if demanded > 1.0:
        x = solve(lambda found, _: found[0].torque_share - 1.0, x)
        point, velocity, thrust, setting = seen(float(x[0] * top), float(x[1]))
    if setting.reach[0] < 1.0:
        raise RuntimeError(f"{ship.name}: the thrust for {order:g} m/s is below the surface")
    held = float(setting.thrust[0])
    return SettledState(point, velocity, thrust, held, float(ordered[0]), demanded)


def run_cases(count: int) -> pd.DataFrame:
    """Return a row for each ship, estimate, version, order and draw; draw 0 has no errors."""
    rows = []
    for name, estimate in itertools.product(SHIPS, ESTIMATES):
        ship = get_ship(name)
        versions = {v: make_optimiser(ship, v, estimate) for v in (NOMINAL, WORST, EXPECTED)}
        top = float(combinator_curve(ship).ship_speed[-1])
        draws = [Errors(), *draw_errors(count)]
        for draw, errors in enumerate(draws):
            actual = errors.true_ship(ship)
            for (order, part), version in itertools.product(ORDERS.items(), versions):
                state = settle(actual, versions[version], estimate, part * top)
                rows.append(
                    {"ship": name, "estimate": estimate, "order": order, "version": version}
                    | {"draw": draw}
                    | errors._asdict()
                    | {
                        "fuel_kg_nmi": state.fuel_per_mile,
                        "ship_speed_m_s": state.point.ship_speed,
                        "shortfall": state.shortfall,
                        "demanded_share": state.demanded_share,
                        "exponent": ship.hull.resistance_exponent,
                    }
                )
        print_dot()
    return pd.DataFrame(rows)


def compare(cases: pd.DataFrame) -> pd.DataFrame:
    """Return the paired comparison of each robust version with the nominal one.

    Fuel per mile is at equal speed: that of the robust version, scaled by the power of the speed in the
    resistance to the speed of the nominal version in the same draw.
    """
    rows = []
    keys = ["ship", "estimate", "order"]
    for group, part in cases.groupby(keys, sort=False):
        by_version = {str(v): own.set_index("draw") for v, own in part.groupby("version")}
        base = by_version[NOMINAL]
        for version in (WORST, EXPECTED):
            own = by_version[version]
            speed = base["ship_speed_m_s"] / own["ship_speed_m_s"]
            fuel = own["fuel_kg_nmi"] / base["fuel_kg_nmi"] * speed ** base["exponent"] - 1.0
            shortfall = own["shortfall"] - base["shortfall"]
            violated, before = own["demanded_share"] > 1.0, base["demanded_share"] > 1.0
            drawn = own.index > 0
            better = np.where(violated == before, fuel < -_LEAST_SAVING, before & ~violated)
            row: dict[str, Any] = {**dict(zip(keys, group, strict=True)), "version": version}
            for what, values in (
                ("fuel_percent", 100.0 * fuel),
                ("speed_loss_percent", 100.0 * (1.0 - 1.0 / speed)),
                ("shortfall_points", 100.0 * shortfall),
            ):
                change = mean_with_interval(values[drawn])
                row |= {what + end: v for end, v in zip(ENDS, change, strict=True)}
                row[f"{what}_without_errors"] = float(values[~drawn].iloc[0])
            for what, hits in (
                ("nominal_violated", before),
                ("violated", violated),
                ("better", better),
            ):
                count, whole = int(np.sum(hits[drawn])), int(np.sum(drawn))
                parts = (count / whole, *wilson_interval(count, whole))
                row |= {what + end: v for end, v in zip(ENDS, parts, strict=True)}
            hit = drawn & before.to_numpy()
            for what, values in (("nominal_shortfall", base), ("shortfall", own)):
                lost = 100.0 * values["shortfall"]
                row[f"{what}_percent"] = float(lost[drawn].mean())
                row[f"{what}_percent_where_violated"] = float(lost[hit].mean())
            rows.append(row)
    return pd.DataFrame(rows)


def page_table(table: pd.DataFrame, estimate: str) -> pd.DataFrame:
    """Return the table of one estimate for the page."""
    rows = []
    for _, line in table[table["estimate"] == estimate].iterrows():
        cells = {name: line[name] for name in ("ship", "order", "version")}
        for heading, what in (
            ("fuel per mile %", "fuel_percent"),
            ("thrust shortfall, points", "shortfall_points"),
        ):
            cells[heading] = _with_interval(line, what, lambda value: _rounded(value, "+.2f"))
        for heading, what in (
            ("limit violated, nominal", "nominal_violated"),
            ("limit violated", "violated"),
            ("better", "better"),
        ):
            cells[heading] = _with_interval(line, what, lambda value: f"{value:.2f}")
        for heading, what in (
            ("fuel without errors %", "fuel_percent"),
            ("shortfall without errors, points", "shortfall_points"),
        ):
            cells[heading] = _rounded(float(line[f"{what}_without_errors"]), "+.2f")
        rows.append(cells)
    return pd.DataFrame(rows)


def _range_of(table: pd.DataFrame) -> str:
    """Return the range of the mean change of the fuel in the worst case at cruise, as text."""
    chosen = (table["order"] == "cruise") & (table["version"] == WORST)
    low, high = table["fuel_percent"][chosen].min(), table["fuel_percent"][chosen].max()
    return f"{low:.3f} to {high:.3f} %"


def _rounded(value: float, form: str) -> str:
    """Return a number as text, without a sign where it is rounded to 0."""
    return "0" if abs(value) < 0.005 else f"{value:{form}}"


def _with_interval(line: Any, what: str, as_text: Callable[[float], str]) -> str:
    middle, low, high = (as_text(float(line[what + end])) for end in ENDS)
    return middle if middle == low == high else f"{middle} ({low} to {high})"


def main(arguments: list[str] | None = None) -> None:
    """Solve, compare and write ``robust-optimiser.md`` and its table."""
    parser = make_parser("robust_optimiser", __doc__, "out/robust-optimiser")
    parser.add_argument("--draws", type=int, default=200, help="number of draws of the errors")
    options = parser.parse_args(arguments)
    if options.draws < 2:
        parser.error("--draws must be at least 2")
    table = compare(run_cases(options.draws))
    print()
    kq, eta_r, wake = BOUNDS
    write_results(
        __file__,
        options.out,
        "Robust CPP optimiser",
        table,
        draws=options.draws,
        first=FIRST_SEED,
        last=FIRST_SEED + options.draws - 1,
        kq=round(100.0 * kq),
        eta_r=round(100.0 * eta_r),
        wake=wake,
        rise=round(100.0 * (RISE - 1.0)),
        by_wake=page_table(table, BY_WAKE),
        by_torque=page_table(table, BY_TORQUE),
        cruise_cost=_range_of(table),
        at_full={
            str(line["ship"]): line.to_dict()
            for _, line in table.iterrows()
            if (line["estimate"], line["order"], line["version"]) == (BY_WAKE, "full", WORST)
        },
    )


if __name__ == "__main__":
    main()
