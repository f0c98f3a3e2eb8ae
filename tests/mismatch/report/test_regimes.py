"""Residuals over the operating regime, and the curve of what has no name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from shaftline.mismatch.report import figures
from shaftline.mismatch.report.figures import AFTER, BEFORE, HELD_OUT
from shaftline.mismatch.search.fitting import Colour
from shaftline.plant import load_ship

from ..diagnoses import ROWS, TIME, diagnosis_of
from .test_figures import Drawn, lines, shaded


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    kept: Drawn = []

    def keep(figure: Any, label: str) -> str:
        kept.append((figure.axes[0], label))
        return label

    monkeypatch.setattr(figures, "with_label", keep)
    return kept


def marked(axes: Any, colour: str) -> Any:
    """The means of a bin; the ends of their intervals have other markers."""
    return next(
        line for line in axes.lines if (line.get_color(), line.get_marker()) == (colour, "o")
    )


def test_findings_point_to_their_balances_once() -> None:
    found = diagnosis_of("explained")
    first = found.findings[0]
    other = replace(first, row=0)
    assert figures.balances_to_show(replace(found, findings=[first, other, first])) == [1, 0]


def test_without_findings_the_shape_the_colour_or_what_wanders_most_is_shown() -> None:
    assert figures.balances_to_show(diagnosis_of("unexplained")) == [1]
    thrust = replace(diagnosis_of("unexplained").shape, balance="thrust")  # type: ignore[type-var]
    left = Colour(0, 0, 0.01, 0.02, 9.0)
    assert figures.balances_to_show(diagnosis_of("unexplained", shape=thrust, left_over=left)) == [
        0
    ]
    residual = np.random.default_rng(0).standard_normal((2, ROWS))
    residual[1] += np.sin(TIME / 20.0)  # slow: its means over blocks keep its size
    quiet = diagnosis_of("nothing-missing", residual_before=residual * np.array([[9.0], [1.0]]))
    assert figures.balances_to_show(quiet) == [1]


def test_signals_are_those_of_the_corrected_ship_that_move() -> None:
    found = figures.signals_to_show(diagnosis_of("explained"))
    assert list(found) == ["shaft_speed", "drive"]  # the pitch rests
    assert found["shaft_speed"][1:] == ("shaft speed", "rad/s")
    assert found["drive"][1:] == ("fuel rack demand", "mm")
    assert (found["shaft_speed"][0] == diagnosis_of("explained").after["shaft_speed_rad_s"]).all()
    bench = load_ship("rov-thruster")
    volts = figures.signals_to_show(diagnosis_of("nothing-missing", ship=bench, corrected=bench))
    assert volts["drive"][1:] == ("motor voltage demand", "V")


@pytest.mark.parametrize(("moves", "shown"), [(0.021, True), (0.019, False)])
def test_a_signal_must_move_a_fiftieth_of_its_size(moves: float, shown: bool) -> None:
    drive = np.linspace(-20.0, -20.0 * (1.0 - moves), ROWS)
    assert ("drive" in figures.signals_to_show(diagnosis_of("explained", drive=drive))) is shown


def test_bins_of_equal_count_have_means_and_intervals() -> None:
    rng = np.random.default_rng(2)
    signal, residual = rng.standard_normal((2, 2400))
    x, y, error = figures.bin_means(signal, residual, 20)
    blocks = signal.reshape(120, 20).mean(axis=1), residual.reshape(120, 20).mean(axis=1)
    order = np.argsort(blocks[0])
    first = order[:10]  # twelve bins of ten
    assert len(x) == len(y) == len(error) == 12
    assert x[0] == pytest.approx(blocks[0][first].mean())
    assert y[0] == pytest.approx(blocks[1][first].mean())
    assert error[0] == pytest.approx(1.96 * blocks[1][first].std(ddof=1) / np.sqrt(10.0))
    assert (np.diff(x) > 0.0).all()
    assert len(figures.bin_means(signal[:500], residual[:500], 20)[0]) == 5  # five blocks a bin


def test_each_located_balance_is_drawn_over_each_signal(drawn: Drawn) -> None:
    labels = figures.regime_panels(diagnosis_of("explained"))
    assert labels == [  # type: ignore[comparison-overlap]
        "residual of the engine balance over shaft speed",
        "residual of the engine balance over fuel rack demand",
    ]
    axes = drawn[0][0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "shaft speed [rad/s]",
        "missing torque [kN m]",
    )
    diagnosis = diagnosis_of("explained")
    x, y, _ = figures.bin_means(
        diagnosis.after["shaft_speed_rad_s"], diagnosis.residual_before[1], 20
    )
    before, after = marked(axes, BEFORE), marked(axes, AFTER)
    assert before.get_xdata() == pytest.approx(x)
    assert before.get_ydata() == pytest.approx(y / 1e3)
    _, y, _ = figures.bin_means(
        diagnosis.after["shaft_speed_rad_s"], diagnosis.residual_after[1], 20
    )
    assert after.get_ydata() == pytest.approx(y / 1e3)


def test_only_two_balances_are_drawn_and_only_what_was_changed(drawn: Drawn) -> None:
    found = diagnosis_of("explained")
    both = [replace(found.findings[0], row=row) for row in (0, 1)]
    assert len(figures.regime_panels(replace(found, findings=both))) == 4
    drawn.clear()
    figures.regime_panels(diagnosis_of("nothing-missing"))
    assert AFTER not in lines(drawn[0][0])


def test_the_curve_is_drawn_over_what_the_balance_lacks(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("unexplained")
    assert figures.shape_panel(diagnosis) == [  # type: ignore[comparison-overlap]
        "shape of the residual of the engine balance"
    ]
    axes = drawn[0][0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "shaft speed [rad/s]",
        "missing torque [kN m]",
    )
    curve = lines(axes)[BEFORE]
    assert curve.get_xdata() == pytest.approx([9.0, 10.0, 11.0])
    assert curve.get_ydata() == pytest.approx([0.0, -12.0, 0.5])
    (dots,) = (line for line in axes.lines if line.get_marker() == ".")
    blocks = diagnosis.before["shaft_speed_rad_s"].reshape(60, 20).mean(axis=1)
    assert dots.get_xdata() == pytest.approx(blocks)  # the nominal ship's own signal
    assert dots.get_ydata() == pytest.approx(
        diagnosis.residual_before[1].reshape(60, 20).mean(axis=1) / 1e3
    )
    assert figures.shape_panel(diagnosis_of("explained")) == []


def test_over_time_the_part_set_aside_is_shaded(drawn: Drawn) -> None:
    shape = replace(diagnosis_of("unexplained").shape, signal="time", signal_unit="s")  # type: ignore[type-var]
    figures.shape_panel(diagnosis_of("unexplained", shape=shape))
    axes = drawn[0][0]
    assert axes.get_xlabel() == "time [s]"
    assert shaded(axes, HELD_OUT) == [(180.0, 240.0)]
    (dots,) = (line for line in axes.lines if line.get_marker() == ".")
    assert dots.get_xdata() == pytest.approx(TIME.reshape(60, 20).mean(axis=1))
    drawn.clear()
    assert shape is not None
    drive = replace(shape, signal="drive", signal_unit="mm")
    figures.shape_panel(diagnosis_of("unexplained", shape=drive))
    assert drawn[0][0].get_xlabel() == "drive command [mm]"
    assert shaded(drawn[0][0], HELD_OUT) == []


def test_the_curve_stands_in_the_regime_of_its_own_signal(drawn: Drawn) -> None:
    figures.regime_panels(diagnosis_of("unexplained"))
    speed, drive = (axes for axes, _ in drawn)
    dashed = [
        line for line in speed.lines if line.get_linestyle() == "--" and len(line.get_xdata()) == 3
    ]
    assert dashed[0].get_ydata() == pytest.approx([0.0, -12.0, 0.5])
    assert not [line for line in drive.lines if len(line.get_xdata()) == 3]
