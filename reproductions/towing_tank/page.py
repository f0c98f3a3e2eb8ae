"""Compare the towing-tank tests of the anti-spin paper with ours: Table 1 and Figures 3 to 6.

Pivano et al. 2008, section 5. Three assumed numbers are calibrated to the test with anti-spin; the test
without anti-spin, and so the effect of anti-spin, is predicted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import scipy
from matplotlib.figure import Figure

from shaftline.baselines.thrust_control import ThrustControl, ThrustControlTuning
from shaftline.display.figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure
from shaftline.plant import Ship, load_ship
from shaftline.plant.propeller import propeller_load
from shaftline.plant.ventilation import suction_head, ventilation_rate

from ..cells import HALF_DIGIT, Cell, Kind, number, printed_number
from ..pages import fill_template, label_axis
from ..side_by_side import Page, Study, cell_table, published_text
from .experiment import Air, Instruments, Programme, TankRun, simulate_test

RIG = "towing-tank"
PRINTED = {"anti-spin": (79.2, 290.0, 0.151), "no anti-spin": (89.1, 378.0, 0.123)}
"""Table 1: mean thrust [N], mean power [W], eta_E [-]."""
FRICTION = "transmission.coulomb_friction_engine_side_N_m"
NEAR = 0.5  # h/R up to which the propeller is called near the surface
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
    samples, power = test.samples, float(test.motor_power.mean())
    thrust = samples["thrust"] * np.sign(test.thrust_order)
    near = programme.submergence(test.times) < NEAR
    return Numbers(
        float(thrust.mean()),
        power,
        float(np.mean(samples["thrust"] * samples["advance_velocity"])) / power,
        float(thrust[near].mean()) if near.any() else float("nan"),
        float(np.abs(samples["shaft_speed"]).max()),
        float(test.motor_power.max()),
        float(np.sqrt(np.mean((samples["thrust"] - test.thrust_order) ** 2))),
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
        off,
        np.ones(3),
        diff_step=[0.01, 0.01, 0.01],
        x_scale=[0.1, 0.1, 1.0],
        max_nfev=15,
        bounds=([0.5, 0.5, 0.0], [2.0, 2.0, 9.0]),
    )
    thrust, carriage, friction = map(float, begin * best.x)
    return Programme(thrust_N=thrust, carriage_m_s=carriage), friction


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
    controls = (
        ThrustControl(believed or ship, anti_spin=switch, **tuning) for switch in (True, False)
    )
    tests = (simulate_test(ship, control, programme, instruments) for control in controls)
    return Pair(*(numbers_of(test, programme) for test in tests))


class Results(NamedTuple):
    """All results of the page."""

    calm: TankRun
    on: TankRun
    off: TankRun
    programme: Programme
    calm_numbers: Numbers
    pair: Pair
    oracle: Numbers
    detection: tuple[float, float]  # time in air that is called air; time called air that is
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
        "what": name,
        "thrust": thrust,
        "power": power,
        "eta_E": efficiency,
        "thrust near the surface": found.near,
        "carriage by thrust": found.carriage,
    }


def _variants(ship: Ship, programme: Programme) -> dict[str, Callable[[], Pair]]:
    """Return the variants that are simulated without a new calibration."""

    def moved(**changes: float) -> Callable[[], Pair]:
        return lambda: pair(ship, replace(programme, **changes))

    def believes(key: str, value: float) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, believed=ship.with_values({key: value}))

    def reads(**wrong: Any) -> Callable[[], Pair]:
        return lambda: pair(ship, programme, instruments=Instruments(**wrong))

    viscous = "transmission.viscous_friction_engine_side_N_m_s_rad"
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
        "viscous friction believed half": believes(viscous, 0.004),
        "motor gives 2 % less than ordered": reads(torque_gain=0.98),
        "motor gives 2 % more": reads(torque_gain=1.02),
        "speed read with 0.05 rad/s of noise": reads(shaft_speed=0.05),
    }


TICKS = 3 + 1 + len(LIMITS_RAD_S) + len(AIRS) + 15


def compute_results(tick: Callable[[], None]) -> Results:
    """Simulate every test of the page."""
    programme, air, rig = Programme(), Air(), load_ship(RIG)
    ship = air.ship(rig)

    def test(
        hull: Ship, course: Programme, told: Instruments | None = None, **tuning: Any
    ) -> TankRun:
        found = simulate_test(hull, ThrustControl(hull, **tuning), course, told)
        tick()
        return found

    calm, on = test(rig, CALM), test(ship, programme)
    off = test(ship, programme, anti_spin=False)
    oracle = test(ship, programme, Instruments(tell_air=True))
    limits, airs, others = [], [], []
    for limit in LIMITS_RAD_S:
        astern = limit * 54.0 / 45.0
        found = pair(ship, programme, ventilated_ahead_rad_s=limit, ventilated_astern_rad_s=astern)
        limits.append({"ahead [rad/s]": limit, "astern [rad/s]": astern, **_row("", found)})
        tick()
    for name, other in AIRS.items():
        fitted, friction = calibrate(other)
        found = pair(other.ship(rig.with_values({FRICTION: friction})), fitted)
        airs.append(
            _row(name, found)
            | {
                "T_pd [N]": fitted.thrust_N,
                "carriage [m/s]": fitted.carriage_m_s,
                "k_f1 [N m]": friction,
                "T with [N]": found.on.thrust,
                "P with [W]": found.on.power,
                "T without [N]": found.off.thrust,
                "P without [W]": found.off.power,
            }
        )
        tick()
    for name, tried in _variants(ship, programme).items():
        others.append(_row(name, tried()))
        tick()
    air_is = on.samples["ventilation"] > 0.5
    both = float(np.sum(air_is & on.detected))
    return Results(
        calm,
        on,
        off,
        programme,
        numbers_of(calm, CALM),
        Pair(numbers_of(on, programme), numbers_of(off, programme)),
        numbers_of(oracle, programme),
        (both / float(air_is.sum()), both / float(on.detected.sum())),
        over_shaft_speed(ship),
        pd.DataFrame(limits).drop(columns="what"),
        pd.DataFrame(airs),
        pd.DataFrame(others),
    )


STYLES = ((TRUTH, "-"), (ESTIMATE, "--"), (PALETTE[1], ":"))
"""Colour and style of the lines of a panel."""


def _panels(test: TankRun, programme: Programme) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return label and lines of every panel of Figures 3 to 6."""
    now, order, speed = test.samples, test.thrust_order, test.samples["shaft_speed"]
    under = programme.submergence(test.times)
    return {
        "torque": (
            "propeller torque [N m]",
            {"Q_p": now["propeller_torque"], "estimated": test.torque_estimate},
        ),
        "ratio": ("beta_Q (cut at -0.5 and 2)", {"": np.clip(test.torque_ratio, -0.5, 2.0)}),
        "air": (
            "submergence, ventilation [-]",
            {"h/R": under, "nu": test.detected, "air": now["ventilation"]},
        ),
        "motor": ("motor torque Q_md [N m]", {"": now["brake_torque"]}),
        "thrust": ("thrust [N]", {"T_p": now["thrust"], "T_pd": order}),
        "thrust error": ("T_p - T_pd [N]", {"": now["thrust"] - order}),
        "speed": ("shaft speed [rad/s]", {"omega": speed, "omega_d": test.reference}),
        "speed error": ("omega - omega_d [rad/s]", {"": speed - test.reference}),
        "power": ("P_m [W]", {"": test.motor_power}),
    }


def _draw(axis: Any, test: TankRun, name: str, programme: Programme) -> None:
    """Draw a panel of :func:`_panels`."""
    label, lines = _panels(test, programme)[name]
    for (words, values), (colour, style) in zip(lines.items(), STYLES, strict=False):
        axis.plot(test.times, values, color=colour, linewidth=0.9, linestyle=style, label=words)
    label_axis(axis, y=label)
    if len(lines) > 1:
        axis.legend(fontsize=7, loc="upper right", ncols=2)
    if name == "thrust":
        speed = axis.twinx()
        speed.plot(test.times, test.samples["advance_velocity"], color=THESIS, linewidth=0.9)
        label_axis(speed, y="u_a [m/s] (grey)")
    if name == "ratio":
        detector = ThrustControlTuning().detector
        for level in (detector.on_below, detector.off_above):
            axis.axhline(level, color=ESTIMATE, linewidth=0.7, linestyle=":")


def panels(test: TankRun, programme: Programme, *columns: tuple[str, ...]) -> Figure:
    """Draw the panels of a test by column."""
    names = np.array(columns).T
    size = (11.0, 9.5) if len(columns) > 1 else (8.0, 9.5)
    figure, axes = new_figure(names.shape[0], names.shape[1], size)
    for axis, name in zip(axes.flat, names.flat, strict=True):
        _draw(axis, test, name, programme)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]", fontsize=8)
    return figure


def power_panels(found: Results) -> Figure:
    """Draw the motor power, as Figure 6."""
    figure, axes = new_figure(3, 1, (8.0, 6.5))
    tests = {"calm water": found.calm, "with anti-spin": found.on, "without": found.off}
    for axis, (name, test) in zip(axes.flat, tests.items(), strict=True):
        _draw(axis, test, "power", found.programme)
        axis.set_ylim(-100.0, 1.05 * max(t.motor_power.max() for t in tests.values()))
        axis.legend([name], fontsize=7, loc="upper right")
    axes[-1, 0].set_xlabel("time [s]", fontsize=8)
    return figure


def _assumed() -> pd.DataFrame:
    """Return all assumed values, which the paper does not print."""
    rows: list[dict[str, Any]] = []
    tuning = ThrustControlTuning()
    for title, thing in (
        ("programme", Programme()),
        ("air", Air()),
        ("law", tuning),
        ("observer", tuning.observer),
        ("detection", tuning.detector),
    ):
        values = {f.name: getattr(thing, f.name) for f in fields(thing)}
        told = ", ".join(f"{k} {v:g}" for k, v in values.items() if isinstance(v, float))
        rows.append({"of": title, "assumed": told})
    return pd.DataFrame(rows)


WORDS = ("mean thrust [N]", "mean power [W]", "eta_E")
TEXT = "section 5"  # section of the paper's words


def _change(ratio: float) -> float:
    return 100.0 * (ratio - 1.0)


def cells(found: Results) -> list[Cell]:
    """Return the printed numbers and words of section 5 with ours."""
    digits = published_text("anti_spin_towing_tank")
    tests = {
        "anti-spin": (found.pair.on, Kind.CALIBRATED),
        "no-anti-spin": (found.pair.off, Kind.FREE),
    }
    return [
        *(
            printed_number("Table 1", row, words, ours, text, kind)
            for row, (values, kind) in tests.items()
            for words, ours, text in zip(WORDS, values[:3], digits.loc[row], strict=True)
        ),
        number(TEXT, "highest shaft speed without anti-spin [rad/s]", "", found.pair.off.highest_speed,
               75.0, 0.5, HALF_DIGIT, Kind.INPUT),
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


def _in_air(test: TankRun, values: Any, direction: float = 0.0) -> float:
    """Return the mean of values in air that is detected, by direction of thrust or for both."""
    air = (test.samples["ventilation"] > 0.8) & test.detected
    if direction:
        air &= test.thrust_order * direction > 0.0
    return float(np.mean(values[air]))


def _speeds_in_air(found: Results, direction: float = 0.0) -> float:
    """Return the shaft speed in air, without over with anti-spin, by direction of thrust or for both."""
    off, on = (
        _in_air(t, np.abs(t.samples["shaft_speed"]), direction) for t in (found.off, found.on)
    )
    return off / on


def _fields(found: Results) -> dict[str, Any]:
    """Return the numbers that the text of the page names."""
    thrust, power, _ = found.pair.ratios
    (t, p, e), (t0, p0, e0) = PRINTED["anti-spin"], PRINTED["no anti-spin"]
    steady = found.steady.set_index("shaft speed [rad/s]")
    off, on = (_in_air(test, test.motor_power) for test in (found.off, found.on))
    onsets = [steady.index[np.argmax(np.diff(steady[f"h/R {h:g}"]) < 0.0)] for h in (0.5, 1.0)]
    return {
        # eta_E = (T / P) u, with u the carriage's speed weighted by thrust
        "gains": [_change(r) for r in (thrust / power, found.pair.carriage, found.pair.ratios[2])],
        "printed": [
            _change(r) for r in ((t / p) / (t0 / p0), (e * p / t) / (e0 * p0 / t0), e / e0)
        ],
        "tried": [_change(r) for r in pd.concat([found.airs, found.others])["carriage by thrust"]],
        "shares": [
            steady.loc[45.0, f"h/R {h:g}"] / steady.loc[75.0, f"h/R {h:g}"] for h in (0.25, 0.5)
        ],
        "ahead": _speeds_in_air(found, 1.0),
        "astern": _speeds_in_air(found, -1.0),
        "onsets": onsets,
        "peaks": off / on,
        "friction": float(load_ship(RIG).record()["coulomb_engine_side"]),
        "near": NEAR,
    }


def page(found: Results) -> Page:
    """Return the page of the results."""
    compared = cells(found)
    body = fill_template(
        Path(__file__).with_suffix(".md"),
        found=found,
        assumed=_assumed(),
        table=cell_table(compared),
        changes=_changes(found),
        **_fields(found),
    )
    kept, plain = found.programme, ("thrust", "thrust error", "speed", "speed error", "motor")
    left, right = (
        ("torque", "ratio", "air", "motor"),
        ("thrust", "thrust error", "speed", "speed error"),
    )
    drawn = {  # as Figures 3 to 6
        "towing-tank-calm": panels(found.calm, CALM, plain),
        "towing-tank-anti-spin": panels(found.on, kept, left, right),
        "towing-tank-without": panels(found.off, kept, plain),
        "towing-tank-power": power_panels(found),
    }
    ratios = dict(zip(("thrust", "power", "eta_E"), found.pair.ratios, strict=True))
    tests = {"anti-spin": found.pair.on, "no anti-spin": found.pair.off, "calm": found.calm_numbers}
    numbers = {name: test._asdict() for name, test in tests.items()} | {"ratios": ratios}
    return Page(compared, body, drawn, numbers)


TITLE = "Anti-spin on the towing-tank rig (Pivano et al. 2008, section 5)"
STUDY = Study(TITLE, lambda tick: page(compute_results(tick)), TICKS)
