"""Tables 3-1 to 3-10: transfers of the linear observers and of I&I, from the observers' own matrices.

With a gain K = (k1, k2), k2 < 0, and den(s) = s^2 + k1 s - k2 / I_R, eqs. 3-3 to 3-5 give

    omega^/omega = (k1 s - k2/I_R) / den      M_p^/omega = k2 s / den
    omega^/M_m   = (s/I_R) / den              M_p^/M_m   = (-k2/I_R) / den

so M_p^/omega and omega^/M_m have a zero at 0 exactly; of the first the thesis prints rounding.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from shaftline.core.lazy import control
from shaftline.observers import get_observer
from shaftline.observers.immersion_invariance import ImmersionInvariance
from shaftline.observers.linear import LinearObserver, shaft_model
from shaftline.observers.torque_curve import torque_slopes
from shaftline.plant import Ship, equilibrium

from ..side_by_side import published

OUTPUTS, INPUTS = ("omega", "M_p"), ("omega", "M_m")
LUENBERGER = ("luenberger-low", "luenberger-moderate", "luenberger-high")
KALMAN = "shaft-kalman"

PRINTED_GAINS = {
    "luenberger-high": (1.1e5, -1.4e13),
    "luenberger-moderate": (1.1e2, -1.4e7),
    "luenberger-low": (11.0, -1.4e5),
}
"""K of section 3-1-3, to two digits."""

_ROUNDING = 1e-9
"""Zeros and gains below this, over the slowest pole and the gain to the torque, are 0."""


def linear_observer(name: str, ship: Ship) -> control.StateSpace:
    """An observer with a constant gain, from measured omega and M_m to estimated omega and M_p.

    Args:
        name: of it.
        ship: as believed.
    """
    observer = get_observer(name)
    assert isinstance(observer, LinearObserver)
    a, b, c = shaft_model(observer.inertia(ship))
    gain = observer.gain(ship)
    return control.ss(
        a - gain @ c, np.hstack([gain, b]), np.eye(2), np.zeros((2, 2)),
        inputs=[f"{name} measured" for name in INPUTS], outputs=[f"{name}^" for name in OUTPUTS],
    )  # fmt: skip


def gains(name: str, ship: Ship) -> tuple[float, float]:
    """K of a linear observer, [1/s] and [N m/rad].

    Args:
        name: of it.
        ship: as believed.
    """
    observer = get_observer(name)
    assert isinstance(observer, LinearObserver)
    k1, k2 = map(float, observer.gain(ship)[:, 0])
    return k1, k2


def closed_form(
    k1: float, k2: float, inertia: float, output: str, source: str
) -> tuple[float, float]:
    """Zero [rad/s], NaN where there is none, and steady gain of one of the four transfers.

    Args:
        k1: gain on the error of the shaft speed [1/s].
        k2: the same for the torque [N m/rad].
        inertia: I_R [kg m2].
        output: ``omega`` or ``M_p``.
        source: ``omega`` or ``M_m``.
    """
    if output == "omega":
        return (k2 / inertia / k1, 1.0) if source == "omega" else (0.0, 0.0)
    return (0.0, 0.0) if source == "omega" else (np.nan, 1.0)


def linear_transfers(ship: Ship) -> pd.DataFrame:
    """Tables 3-1 to 3-8: zero and steady gain, printed, by the closed form and of the observer itself.

    Args:
        ship: the thesis's frigate.
    """
    rows = []
    printed = published("advance_velocity_thesis_observer_transfers").reset_index()
    for cell in printed.itertuples():
        observer = get_observer(cell.observer)
        assert isinstance(observer, LinearObserver)
        inertia = observer.inertia(ship)
        k1, k2 = gains(cell.observer, ship)
        system = linear_observer(cell.observer, ship)
        one = system[OUTPUTS.index(cell.output), INPUTS.index(cell.input)]
        slowest = float(np.abs(system.poles()).min())
        zeros = [z.real for z in map(complex, one.zeros()) if abs(z) < 1e6 * slowest]
        zero = zeros[0] if zeros else np.nan
        size = abs(k1) * inertia if (cell.output, cell.input) == ("M_p", "omega") else 1.0
        gain = float(np.real(one.dcgain()))
        follows = closed_form(k1, k2, inertia, cell.output, cell.input)
        rows.append(
            {
                "table": cell.table,
                "observer": cell.observer,
                "transfer": f"{cell.output}^ / {cell.input}",
                "zero printed": cell.zero_rad_s,
                "zero follows": follows[0],
                "zero ours": 0.0 if abs(zero) < _ROUNDING * slowest else zero,
                "gain printed": cell.dc_gain,
                "gain follows": follows[1],
                "gain ours": 0.0 if abs(gain) < _ROUNDING * size else gain,
            }
        )
    return pd.DataFrame(rows)


def immersion_invariance(
    ship: Ship, point: str, gamma: float, *, as_printed: bool
) -> control.StateSpace:
    """I&I linear about A to D, from measured omega and M_m to v_a^ (eq. 3-13).

    Args:
        ship: the thesis's frigate.
        point: A, B, C or D.
        gamma: gain [m/rad].
        as_printed: whether M_p is taken not to depend on the estimate, as Tables 3-9 and 3-10 do; it is
            what makes the observer converge.
    """
    inputs = published("advance_velocity_thesis_working_points").loc[point]
    found = equilibrium(ship, float(inputs["fuel_rack_mm"]), float(inputs["pitch_ratio"]))
    by_speed, by_velocity = torque_slopes(
        ship.record(), found.outputs.advance_velocity, found.state.shaft_speed,
        found.outputs.pitch_ratio,
    )  # fmt: skip
    inertia = float(ship.record()["inertia_propeller_side"])
    own = 0.0 if as_printed else by_velocity
    rate = gamma / inertia
    return control.ss(
        [[rate * own]], [[rate * (by_speed + own * gamma), -rate]], [[1.0]], [[gamma, 0.0]],
        inputs=["omega measured", "M_m measured"], outputs=["v_a^"],
    )  # fmt: skip


def invariance_transfers(ship: Ship) -> pd.DataFrame:
    """Table 3-10: pole of v_a^/M_m, printed and of the observer itself; it has no zero.

    Args:
        ship: the thesis's frigate.
    """
    rows = []
    for point in "AD":
        for tuning in ("low", "high"):
            gamma = ImmersionInvariance.tunings[tuning].gain
            pole: dict[bool, float] = {}
            for as_printed in (True, False):
                one = immersion_invariance(ship, point, gamma, as_printed=as_printed)[0, 1]
                (pole[as_printed],) = one.poles().real
                assert len(one.zeros()) == 0
            rows.append(
                {"table": "3-10", "point": point, "gamma": gamma, "pole printed": 0.0,
                 "pole as eq. 3-13 is printed": pole[True], "pole of the observer": pole[False]}
            )  # fmt: skip
    return pd.DataFrame(rows)
