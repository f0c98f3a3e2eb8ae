"""Compare the towing-tank tests of the anti-spin paper with ours: Table 1 and Figures 3 to 6.

Pivano et al. 2008, section 5. Three assumed numbers are calibrated to the test with anti-spin; the test
without anti-spin, and so the effect of anti-spin, is predicted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from shaftline.baselines.thrust_control import ThrustControl, ThrustControlTuning
from shaftline.display.figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load
from shaftline.plant.ventilation import suction_head, ventilation_rate

from ..cells import Cell, Kind, half_digit, number
from ..pages import fill_template
from ..side_by_side import Page, Study, cell_table, published_text
from .experiment import Air, Instruments, Programme, TankRun, simulate_test

RIG = "towing-tank"
PRINTED = {"anti-spin": (79.2, 290.0, 0.151), "no anti-spin": (89.1, 378.0, 0.123)}
"""Table 1: mean thrust [N], mean power [W], eta_E [-]."""
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
NEAR = 0.5
"""h/R up to which the propeller is called near the surface."""
CALM = Programme(mean_submergence=3.2, motion=0.0)

AIRS = {
    "as above": Air(),
    "thrust loss 0.95, torque loss 0.91": Air(thrust_loss=0.95, torque_loss=0.91),
    "thrust loss 0.6, torque loss 0.52": Air(thrust_loss=0.6, torque_loss=0.52),
    "suction gain 0.35": Air(suction_gain=0.35),
    "suction gain 0.7": Air(suction_gain=0.7),
    "onset 0.3": Air(onset_submergence=0.3),
    "no loss of disc area": Air(surface_loss=0.0),
    "times of a propeller of 4.2 m": Air(growth_s=0.5, washout_s=1.5),
}
LIMITS_RAD_S = (25.0, 30.0, 38.0, 45.0, 52.0, 60.0, 75.0)

SPEEDS_RAD_S = (20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0)
SUBMERGENCES = (0.25, 0.5, 0.8, 1.0, 1.5)
"""h/R at which the steady thrust is shown over the shaft speed."""


class Numbers(NamedTuple):
    """Key numbers of a test."""

    thrust: float  # mean of |T| [N]
    power: float  # mean [W]
    efficiency: float  # eta_E, eq. 27 [-]
    thrust_near: float  # mean of |T| near the surface [N]
    highest_speed: float  # [rad/s]
    highest_power: float  # [W]
    tracking: float  # rms of T - T_pd [N]


def numbers_of(test: TankRun, programme: Programme) -> Numbers:
    """Return key numbers of a test; thrust counts in the direction of its set-point."""
    thrust = test.samples["thrust"] * np.sign(test.thrust_order)
    power = float(test.motor_power.mean())
    near = programme.submergence(test.times) < NEAR
    useful = float(np.mean(test.samples["thrust"] * test.samples["advance_velocity"]))
    return Numbers(
        float(thrust.mean()),
        power,
        useful / power,
        float(thrust[near].mean()) if near.any() else float("nan"),
        float(np.abs(test.samples["shaft_speed"]).max()),
        float(test.motor_power.max()),
        float(np.sqrt(np.mean((test.samples["thrust"] - test.thrust_order) ** 2))),
    )


def calibrate(air: Air) -> tuple[Programme, float]:
    """Return programme and Coulomb friction [N m] that give the first row of Table 1.

    Thrust set-point, carriage speed and friction are fitted to thrust, power and eta_E of the test with
    anti-spin. The other test is not used.
    """
    begin = np.array([120.0, 0.58, 0.1])

    def off(scales: Any) -> Any:
        thrust, carriage, friction = begin * scales
        programme = Programme(thrust_N=thrust, carriage_m_s=carriage)
        ship = air.ship(load_ship(RIG).with_values({FRICTION: max(friction, 0.0)}))
        found = numbers_of(simulate_test(ship, ThrustControl(ship), programme), programme)
        return np.array(found[:3]) / PRINTED["anti-spin"] - 1.0

    best = scipy.optimize.least_squares(
        off, np.ones(3), diff_step=[0.01, 0.01, 0.01], x_scale=[0.1, 0.1, 1.0], max_nfev=15,
        bounds=([0.5, 0.5, 0.0], [2.0, 2.0, 9.0]),
    )  # fmt: skip
    thrust, carriage, friction = begin * best.x
    return Programme(thrust_N=float(thrust), carriage_m_s=float(carriage)), float(friction)


class Pair(NamedTuple):
    """Key numbers of a test with and without anti-spin."""

    on: Numbers
    off: Numbers

    @property
    def ratios(self) -> tuple[float, float, float]:
        """Return thrust, power and eta_E with over without anti-spin [-]."""
        thrust, power, efficiency = (a / b for a, b in zip(self.on[:3], self.off[:3], strict=True))
        return thrust, power, efficiency

    @property
    def carriage(self) -> float:
        """Return the carriage speed weighted by thrust, eta_E P / T, with over without [-]."""
        on, off = (n.efficiency * n.power / n.thrust for n in self)
        return on / off

    @property
    def near(self) -> float:
        """Return the thrust near the surface, with over without [-]."""
        return self.on.thrust_near / self.off.thrust_near


def pair(
    ship: Ship,
    programme: Programme,
    *,
    believed: Ship | None = None,
    instruments: Instruments | None = None,
    **tuning: Any,
) -> Pair:
    """Simulate both tests of a rig; ``believed`` is the controller's model of it, exact by default."""
    believed = ship if believed is None else believed
    on, off = (
        numbers_of(
            simulate_test(
                ship, ThrustControl(believed, anti_spin=switch, **tuning), programme, instruments
            ),
            programme,
        )
        for switch in (True, False)
    )
    return Pair(on, off)


@dataclass(frozen=True)
class Results:
    """All results of the page."""

    calm: TankRun
    on: TankRun
    off: TankRun
    programme: Programme
    calm_numbers: Numbers
    pair: Pair
    oracle: Numbers
    detection: tuple[float, float]
    """Shares of the time in air that is called air, and of the time called air that is."""
    steady: pd.DataFrame
    limits: pd.DataFrame
    airs: pd.DataFrame
    others: pd.DataFrame


def over_shaft_speed(ship: Ship) -> pd.DataFrame:
    """Return the steady thrust [N] at bollard pull, by shaft speed (rows) and h/R (columns).

    Each shaft speed is reached from the one below, with its ventilation.
    """
    plant, pitch = ship.record(), ship.propeller.pitch_ratio_max
    found: dict[str, Any] = {"shaft speed [rad/s]": SPEEDS_RAD_S}
    for relative in SUBMERGENCES:
        depth, degree, column = 0.5 * relative * ship.propeller.diameter_m, 0.0, []
        for speed in SPEEDS_RAD_S:
            wetted = propeller_load(plant, 0.0, speed, pitch, depth, 0.0)
            suction = suction_head(plant, wetted.thrust_coefficient, speed)
            for _ in range(2000):  # 20 s
                degree += 0.01 * ventilation_rate(plant, degree, relative, suction)
            column.append(propeller_load(plant, 0.0, speed, pitch, depth, degree).thrust)
        found[f"h/R {relative:g}"] = column
    return pd.DataFrame(found)


def _row(name: str, found: Pair) -> dict[str, Any]:
    thrust, power, efficiency = found.ratios
    return {
        "what": name, "thrust": thrust, "power": power, "eta_E": efficiency,
        "thrust near the surface": found.near, "carriage by thrust": found.carriage,
    }  # fmt: skip


def _variants(ship: Ship, programme: Programme) -> dict[str, Callable[[], Pair]]:
    """Return the variants that are simulated without a new calibration."""

    def moved(**changes: float) -> Callable[[], Pair]:
        return lambda: pair(ship, replace(programme, **changes))

    def believes(key: str, value: float) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, believed=ship.with_values({key: value}))

    def reads(**wrong: Any) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, instruments=Instruments(**wrong))

    return {
        "as above": moved(),
        "motion's period 4 s": moved(motion_period_s=4.0),
        "motion's period 8 s": moved(motion_period_s=8.0),
        "motion half a period later": moved(phase=np.pi),
        "motion 0.3 R deeper": moved(mean_submergence=1.55),
        "motion 0.3 R higher": moved(mean_submergence=0.95),
        "ahead and astern 15 s each": moved(half_s=15.0),
        "thrust order 20 % lower": moved(thrust_N=0.8 * programme.thrust_N),
        "carriage 1 m/s": moved(carriage_m_s=1.0),
        "KQ believed 3 % low": believes("propeller.relative_rotative_efficiency", 1.03),
        "KQ believed 3 % high": believes("propeller.relative_rotative_efficiency", 0.97),
        "viscous friction believed half": believes(
            "transmission.viscous_friction_engine_side_N_m_s_rad", 0.004
        ),
        "motor gives 2 % less than ordered": reads(torque_gain=0.98),
        "motor gives 2 % more": reads(torque_gain=1.02),
        "speed read with 0.05 rad/s of noise": reads(shaft_speed=0.05),
    }


TICKS = 3 + 1 + len(LIMITS_RAD_S) + len(AIRS) + 15


def compute_results(tick: Callable[[], None]) -> Results:
    """Simulate every test of the page."""
    programme, air, rig = Programme(), Air(), load_ship(RIG)
    calm = simulate_test(rig, ThrustControl(rig), CALM)
    tick()
    ship = air.ship(rig)
    on = simulate_test(ship, ThrustControl(ship), programme)
    tick()
    off = simulate_test(ship, ThrustControl(ship, anti_spin=False), programme)
    tick()
    oracle = simulate_test(ship, ThrustControl(ship), programme, Instruments(tell_air=True))
    tick()
    limits = []
    for limit in LIMITS_RAD_S:
        astern = limit * 54.0 / 45.0
        found = pair(ship, programme, ventilated_ahead_rad_s=limit, ventilated_astern_rad_s=astern)
        limits.append({"ahead [rad/s]": limit, "astern [rad/s]": astern, **_row("", found)})
        tick()
    airs = []
    for name, other in AIRS.items():
        fitted, friction = calibrate(other)
        found = pair(other.ship(rig.with_values({FRICTION: friction})), fitted)
        airs.append(
            _row(name, found)
            | {"T_pd [N]": fitted.thrust_N, "carriage [m/s]": fitted.carriage_m_s,
               "k_f1 [N m]": friction, "T with [N]": found.on.thrust, "P with [W]": found.on.power,
               "T without [N]": found.off.thrust, "P without [W]": found.off.power}
        )  # fmt: skip
        tick()
    others = []
    for name, tried in _variants(ship, programme).items():
        others.append(_row(name, tried()))
        tick()
    air_is = on.samples["ventilation"] > 0.5
    both = float(np.sum(air_is & on.detected))
    return Results(
        calm, on, off, programme, numbers_of(calm, CALM),
        Pair(numbers_of(on, programme), numbers_of(off, programme)),
        numbers_of(oracle, programme),
        (both / float(air_is.sum()), both / float(on.detected.sum())),
        over_shaft_speed(ship), pd.DataFrame(limits).drop(columns="what"),
        pd.DataFrame(airs), pd.DataFrame(others),
    )  # fmt: skip


def _line(
    axis: Axes, test: TankRun, values: Any, label: str, colour: str, style: str = "-"
) -> None:
    axis.plot(test.times, values, color=colour, linewidth=0.9, linestyle=style, label=label)


def _named(axis: Axes, words: str) -> None:
    axis.set_ylabel(words, fontsize=8)
    axis.tick_params(labelsize=8)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize=7, loc="upper right", ncols=2)


def _thrust(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["thrust"], "T_p", TRUTH)
    _line(axis, test, test.thrust_order, "T_pd", ESTIMATE, "--")
    speed = axis.twinx()
    speed.plot(test.times, test.samples["advance_velocity"], color=THESIS, linewidth=0.9)
    speed.set_ylabel("u_a [m/s] (grey)", fontsize=8)
    speed.tick_params(labelsize=8)
    _named(axis, "thrust [N]")


def _speed(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["shaft_speed"], "omega", TRUTH)
    _line(axis, test, test.reference, "omega_d", ESTIMATE, "--")
    _named(axis, "shaft speed [rad/s]")


def _errors(thrust: Axes, speed: Axes, test: TankRun) -> None:
    _line(thrust, test, test.samples["thrust"] - test.thrust_order, "", TRUTH)
    _named(thrust, "T_p - T_pd [N]")
    _line(speed, test, test.samples["shaft_speed"] - test.reference, "", TRUTH)
    _named(speed, "omega - omega_d [rad/s]")


def _torque(axis: Axes, test: TankRun) -> None:
    _line(axis, test, test.samples["brake_torque"], "", TRUTH)
    _named(axis, "motor torque Q_md [N m]")


def without_panels(test: TankRun) -> Figure:
    """Draw five panels, as Figures 3 and 5."""
    figure, axes = new_figure(5, 1, (8.0, 9.5))
    a, b, c, d, e = axes.flat
    _thrust(a, test)
    _errors(b, d, test)
    _speed(c, test)
    _torque(e, test)
    e.set_xlabel("time [s]", fontsize=8)
    return figure


def with_panels(test: TankRun, programme: Programme) -> Figure:
    """Draw eight panels, as Figure 4."""
    figure, axes = new_figure(4, 2, (11.0, 9.5))
    a, e, b, f, c, g, d, h = axes.flat
    _line(a, test, test.samples["propeller_torque"], "Q_p", TRUTH)
    _line(a, test, test.torque_estimate, "estimated", ESTIMATE, "--")
    _named(a, "propeller torque [N m]")
    _line(b, test, np.clip(test.torque_ratio, -0.5, 2.0), "", TRUTH)
    for level in (
        ThrustControlTuning().detector.on_below,
        ThrustControlTuning().detector.off_above,
    ):
        b.axhline(level, color=ESTIMATE, linewidth=0.7, linestyle=":")
    _named(b, "beta_Q (cut at -0.5 and 2)")
    _line(c, test, programme.submergence(test.times), "h/R", TRUTH)
    _line(c, test, test.detected, "nu", ESTIMATE)
    _line(c, test, test.samples["ventilation"], "air", PALETTE[1], ":")
    _named(c, "submergence, ventilation [-]")
    _torque(d, test)
    _thrust(e, test)
    _errors(f, h, test)
    _speed(g, test)
    for axis in (d, h):
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def power_panels(found: Results) -> Figure:
    """Draw the motor power, as Figure 6."""
    figure, axes = new_figure(3, 1, (8.0, 6.5))
    tests = {"calm water": found.calm, "with anti-spin": found.on, "without": found.off}
    for axis, (name, test) in zip(axes.flat, tests.items(), strict=True):
        _line(axis, test, test.motor_power, name, TRUTH)
        axis.set_ylim(-100.0, 1.05 * max(t.motor_power.max() for t in tests.values()))
        _named(axis, "P_m [W]")
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure


def _assumed() -> pd.DataFrame:
    """Return all assumed values, which the paper does not print."""
    rows: list[dict[str, Any]] = []
    tuning = ThrustControlTuning()
    for title, thing in (
        ("programme", Programme()), ("air", Air()), ("law", tuning),
        ("observer", tuning.observer), ("detection", tuning.detector),
    ):  # fmt: skip
        values = {f.name: getattr(thing, f.name) for f in fields(thing)}
        told = ", ".join(f"{k} {v:g}" for k, v in values.items() if isinstance(v, float))
        rows.append({"of": title, "assumed": told})
    return pd.DataFrame(rows)


WORDS = ("mean thrust [N]", "mean power [W]", "eta_E")
TEXT = "section 5"
"""Section of the paper's words."""


def _change(ratio: float) -> float:
    return 100.0 * (ratio - 1.0)


def cells(found: Results) -> list[Cell]:
    """Return the printed numbers and words of section 5 with ours."""
    digits = published_text("anti_spin_towing_tank")
    compared = []
    for row, values, kind in (
        ("anti-spin", found.pair.on, Kind.CALIBRATED), ("no-anti-spin", found.pair.off, Kind.FREE),
    ):  # fmt: skip
        for words, ours, text in zip(WORDS, values[:3], digits.loc[row], strict=True):
            compared.append(
                number("Table 1", row, words, ours, float(text), half_digit(text),
                       "half a unit of the last printed digit", kind)
            )  # fmt: skip
    highest = found.pair.off.highest_speed
    return [
        *compared,
        number(TEXT, "highest shaft speed without anti-spin [rad/s]", "", highest, 75.0, 0.5,
               "half a unit of the last printed digit", Kind.INPUT),
        Cell(TEXT, f"thrust with over without where h/R < {NEAR:g}", "", found.pair.near, 0.95, 1.05,
             "'practically equal': within 5 %", words="practically equal"),
        Cell(TEXT, "shaft speed in air, without over with", "", _speeds_in_air(found), 1.8, 2.0,
             "'almost double': at most 10 % below 2", words="almost double"),
    ]  # fmt: skip


def _changes(found: Results) -> pd.DataFrame:
    """Return the change of each number of Table 1 by anti-spin [%], ours and printed."""
    with_it, without = (np.array(PRINTED[name]) for name in PRINTED)
    return pd.DataFrame(
        {
            "change by anti-spin [%]": WORDS,
            "ours": [f"{_change(ratio):+.1f}" for ratio in found.pair.ratios],
            "printed": [f"{_change(ratio):+.1f}" for ratio in with_it / without],
        }
    )


def _in_air(test: TankRun, values: Any) -> float:
    """Return the mean of the values while the propeller is in air and this is detected."""
    return float(np.mean(values[(test.samples["ventilation"] > 0.8) & test.detected]))


def _speeds_in_air(found: Results, direction: float = 0.0) -> float:
    """Return the shaft speed in air, without over with anti-spin, by direction of thrust or for both."""

    def speed(test: TankRun) -> float:
        air = (test.samples["ventilation"] > 0.8) & test.detected
        if direction:
            air &= test.thrust_order * direction > 0.0
        return float(np.mean(np.abs(test.samples["shaft_speed"][air])))

    return speed(found.off) / speed(found.on)


def _power_in_air(found: Results) -> float:
    return _in_air(found.off, found.off.motor_power) / _in_air(found.on, found.on.motor_power)


def _fields(found: Results) -> dict[str, Any]:
    """Return the numbers that the text of the page names."""
    thrust, power, _ = found.pair.ratios
    (t, p, e), (t0, p0, e0) = PRINTED["anti-spin"], PRINTED["no anti-spin"]
    steady = found.steady.set_index("shaft speed [rad/s]")
    return {
        # eta_E = (T / P) u, with u the carriage's speed weighted by thrust
        "gains": [_change(r) for r in (thrust / power, found.pair.carriage, found.pair.ratios[2])],
        "printed": [_change(r) for r in ((t / p) / (t0 / p0), (e * p / t) / (e0 * p0 / t0), e / e0)],
        "tried": [_change(r) for r in pd.concat([found.airs, found.others])["carriage by thrust"]],
        "shares": [steady.loc[45.0, f"h/R {h:g}"] / steady.loc[75.0, f"h/R {h:g}"] for h in (0.25, 0.5)],
        "ahead": _speeds_in_air(found, 1.0), "astern": _speeds_in_air(found, -1.0),
        "onsets": [_onset(found, h) for h in (0.5, 1.0)], "peaks": _power_in_air(found),
        "friction": float(load_ship(RIG).record()["coulomb_engine_side"]), "near": NEAR,
    }  # fmt: skip


def page(found: Results) -> Page:
    """Return the page of the results."""
    compared = cells(found)
    body = fill_template(
        Path(__file__).with_suffix(".md"), found=found, assumed=_assumed(), table=cell_table(compared),
        changes=_changes(found), **_fields(found),
    )  # fmt: skip
    figures = {
        "towing-tank-calm": without_panels(found.calm),
        "towing-tank-anti-spin": with_panels(found.on, found.programme),
        "towing-tank-without": without_panels(found.off),
        "towing-tank-power": power_panels(found),
    }
    return Page(compared, body, figures, _numbers(found.pair, found.calm_numbers))


def _onset(found: Results, relative: float) -> float:
    """Return the shaft speed [rad/s] of the table at which the thrust begins to drop."""
    thrust = found.steady[f"h/R {relative:g}"].to_numpy()
    return float(found.steady["shaft speed [rad/s]"][int(np.argmax(np.diff(thrust) < 0.0))])


def _numbers(found: Pair, calm: Numbers) -> dict[str, Any]:
    thrust, power, efficiency = found.ratios
    return {
        "anti-spin": found.on._asdict(), "no anti-spin": found.off._asdict(), "calm": calm._asdict(),
        "ratios": {"thrust": thrust, "power": power, "eta_E": efficiency},
    }  # fmt: skip


STUDY = Study(
    "Anti-spin on the towing-tank rig (Pivano et al. 2008, section 5)",
    lambda tick: page(compute_results(tick)),
    TICKS,
)
