"""Figures over time, over frequency and by name: what is drawn, at which size."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from shaftline.mismatch.report import figures
from shaftline.mismatch.report.figures import (
    AFTER,
    BEFORE,
    HELD_OUT,
    MEASURED,
    WINDOW,
    sea_band,
    smooth_spectrum,
)

from ..diagnoses import ROWS, TIME, candidate, diagnosis_of

Drawn = list[tuple[Any, str]]


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """The axes of every drawing, with its label."""
    kept: Drawn = []

    def keep(figure: Any, label: str) -> str:
        kept.append((figure.axes[0], label))
        return label

    monkeypatch.setattr(figures, "with_label", keep)
    return kept


def lines(axes: Any) -> dict[str, Any]:
    return {line.get_color(): line for line in axes.lines}


def shaded(axes: Any, colour: str) -> list[tuple[float, float]]:
    from matplotlib.colors import to_hex

    spans = [p for p in axes.patches if to_hex(p.get_facecolor()) == colour]
    return [(p.get_x(), p.get_x() + p.get_width()) for p in spans]


def test_traces_show_the_whole_and_the_part_set_aside(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("explained")
    assert figures.trace_panels(diagnosis) == [  # type: ignore[comparison-overlap]
        "pitch ratio over time",
        "pitch ratio over time, held-out data",
        "shaft speed over time",
        "shaft speed over time, held-out data",
    ]
    whole, part = drawn[2][0], drawn[3][0]
    assert whole.get_xlim() == (0.0, TIME[-1])
    assert part.get_xlim() == (180.0, 240.0)
    assert shaded(whole, HELD_OUT) == [(180.0, 240.0)]
    assert shaded(part, HELD_OUT) == []
    assert whole.get_ylabel() == "shaft speed [rad/s]"
    for axes, rows in ((whole, slice(None)), (part, slice(900, None))):
        found = lines(axes)
        assert found[BEFORE].get_ydata() == pytest.approx(
            diagnosis.before["shaft_speed_rad_s"][rows]
        )
        assert found[AFTER].get_ydata() == pytest.approx(diagnosis.after["shaft_speed_rad_s"][rows])
        assert found[AFTER].get_xdata() == pytest.approx(TIME[rows])
        assert found[MEASURED].get_ydata() == pytest.approx(
            diagnosis.measured["shaft_speed_rad_s"][rows]
        )
    assert [line.get_color() for line in whole.lines] == [MEASURED, AFTER, BEFORE]  # dashed on top
    assert lines(whole)[BEFORE].get_linestyle() == "--"


def test_large_channels_are_drawn_with_a_prefix(drawn: Drawn) -> None:
    torque = {"shaft_torque_N_m": np.linspace(-2e5, 1e5, ROWS)}
    figures.trace_panels(
        diagnosis_of("nothing-missing", measured=torque, before=torque, after=torque)
    )
    axes = drawn[0][0]
    assert axes.get_ylabel() == "shaft torque [kN m]"
    assert lines(axes)[BEFORE].get_ydata()[0] == pytest.approx(-200.0)
    assert AFTER not in lines(axes)  # nothing was corrected
    assert lines(axes)[BEFORE].get_linestyle() == "-"


def test_residuals_are_block_means_with_the_spread_about_them(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("explained")
    assert figures.residual_panels(diagnosis) == [  # type: ignore[comparison-overlap]
        "residual of the hull balance over time",
        "residual of the engine balance over time",
    ]
    axes = drawn[1][0]
    assert (axes.get_title("left"), axes.get_ylabel()) == (
        "engine balance",
        "missing torque [kN m]",
    )
    means = diagnosis.residual_before[1].reshape(60, 20).mean(axis=1) / 1e3
    after = diagnosis.residual_after[1].reshape(60, 20).mean(axis=1) / 1e3
    assert lines(axes)[BEFORE].get_ydata() == pytest.approx(means)
    assert lines(axes)[BEFORE].get_xdata() == pytest.approx(TIME.reshape(60, 20).mean(axis=1))
    assert lines(axes)[AFTER].get_ydata() == pytest.approx(after)
    assert shaded(axes, HELD_OUT) == [(180.0, 240.0)]
    assert shaded(axes, WINDOW) == [(60.0, 120.0)]
    assert shaded(drawn[0][0], WINDOW) == []
    (band,) = axes.collections
    low = means - diagnosis.residual_before[1].reshape(60, 20).std(axis=1) / 1e3
    assert band.get_paths()[0].vertices[:, 1].min() == pytest.approx(low.min())
    assert axes.get_xlim() == (0.0, TIME[-1])


def test_a_spread_that_would_hide_the_means_is_told_in_words(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("nothing-missing")
    wide = diagnosis.residual_before.copy()
    wide[1] = np.resize([9e5, -9e5], ROWS) + 100.0 * np.sin(TIME / 30.0)
    figures.residual_panels(diagnosis_of("nothing-missing", residual_before=wide))
    axes = drawn[1][0]
    assert [text.get_text() for text in axes.texts] == ["standard deviation of samples 900 kN m"]
    assert not axes.collections
    assert axes.get_ylim() == pytest.approx((-230.0, 230.0), abs=1.0)  # 100, and 0.65 of 200 about


def test_limits_show_the_means_and_what_fits_of_the_spread() -> None:
    means = [np.array([2.0, 10.0]), np.array([-1.0, 4.0])]
    assert figures._range(means, 1.0) == pytest.approx((-1.0 - 1.3 - 0.55, 10.0 + 1.3 + 0.55))
    assert figures._range(means, 50.0) == pytest.approx((-1.0 - 6.6 - 0.55, 10.0 + 6.6 + 0.55))
    assert figures._range([np.array([3.0, 4.0])], 0.0) == pytest.approx((-0.2, 4.2))  # with zero
    assert figures._range([np.array([-3.0, -4.0])], 0.0) == pytest.approx((-4.2, 0.2))


def test_windows_that_hold_all_are_not_shaded() -> None:
    everywhere = diagnosis_of("unexplained", shape_windows=[(0.0, 235.1), (1.0, 235.9)])
    assert figures._windows(everywhere, 1) == [(1.0, 235.9)]  # 0.98 of 239.8 is 235.0
    assert figures._windows(everywhere, 0) == []
    assert figures._windows(diagnosis_of("unexplained", shape_windows=[(1.0, 236.1)]), 1) == []


def test_spectra_are_amplitudes(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("explained")
    assert figures.spectrum_panels(diagnosis) == [  # type: ignore[comparison-overlap]
        "spectrum of the hull balance's residual",
        "spectrum of the engine balance's residual",
    ]
    axes = drawn[1][0]
    frequency, power = smooth_spectrum(diagnosis.residual_before[1], 5.0, 300)
    found = lines(axes)
    assert found[BEFORE].get_xdata() == pytest.approx(frequency)
    assert found[BEFORE].get_ydata() == pytest.approx(np.sqrt(power))
    both = np.concatenate([found[c].get_ydata() for c in (BEFORE, AFTER)])
    low, high = axes.get_ylim()
    assert low == 10.0 ** np.floor(np.log10(both.min()))
    assert high == 10.0 ** np.ceil(np.log10(both.max()))
    assert axes.get_ylabel() == "amplitude [N m/√Hz]"
    assert axes.get_xlim() == pytest.approx((frequency[0], frequency[-1]))


def test_a_spectrum_is_averaged_over_24_bands_a_decade() -> None:
    values = np.random.default_rng(1).standard_normal(4000)
    frequency, power = smooth_spectrum(values, 10.0, 1000)
    fine, density = welch(values, 10.0, nperseg=1000, detrend=False)
    fine, density = fine[1:], density[1:]
    assert frequency[:3] == pytest.approx(fine[:3])
    assert power[:3] == pytest.approx(density[:3])
    last = fine >= fine[0] * 10 ** (64 / 24)
    assert frequency[-1] == pytest.approx(np.exp(np.log(fine[last]).mean()))
    assert power[-1] == pytest.approx(density[last].mean())
    assert len(smooth_spectrum(values, 10.0, 2)[0]) == 4  # eight rows at least


def test_waves_are_seen_in_a_spectrum_and_white_noise_has_none() -> None:
    rng = np.random.default_rng(4)
    white = rng.standard_normal(12000)
    time = np.arange(12000) * 0.1
    swell = sum(
        0.5 * np.sin(2 * np.pi * f * time + k) for k, f in enumerate((0.13, 0.14, 0.15, 0.16))
    )
    assert sea_band(*smooth_spectrum(white, 10.0, 1200)) is None
    band = sea_band(*smooth_spectrum(white + swell, 10.0, 1200))
    assert band is not None
    assert band[0] < 0.15 < band[1]


@pytest.mark.parametrize(("height", "seen"), [(3.1, True), (2.9, False)])
def test_a_hump_of_three_is_a_sea(height: float, seen: bool) -> None:
    frequency = np.geomspace(0.01, 2.0, 120)
    line = 5.0 * frequency**-1.5
    inside = (frequency > 0.08) & (frequency < 0.2)
    band = sea_band(frequency, line * np.where(inside, height, 1.0))
    assert (band is not None) is seen
    if band is not None:
        assert band == pytest.approx((frequency[inside][0], frequency[inside][-1]))
    assert sea_band(frequency[frequency < 0.4], line[frequency < 0.4]) is None  # no line beyond
    assert sea_band(frequency[frequency > 0.04], line[frequency > 0.04]) is None
    coarse = frequency[::12]
    assert sea_band(coarse, 5.0 * coarse**-1.5 * np.where(coarse > 0.1, 9.0, 1.0)) is None


def test_the_sea_is_shaded_where_a_ship_sails(drawn: Drawn) -> None:
    diagnosis = diagnosis_of("nothing-missing")
    swell = diagnosis.residual_before.copy()
    swell[1] += 2e4 * np.sin(2.0 * np.pi * 0.15 * TIME) + 2e4 * np.sin(2.0 * np.pi * 0.13 * TIME)
    moving = diagnosis_of("nothing-missing", residual_before=swell)
    figures.spectrum_panels(moving)
    (band,) = shaded(drawn[1][0], WINDOW)
    assert band[0] < 0.14 < band[1]
    from shaftline.plant import load_ship

    drawn.clear()
    bench = load_ship("rov-thruster")
    figures.spectrum_panels(
        diagnosis_of("nothing-missing", residual_before=swell, ship=bench, corrected=bench)
    )
    assert shaded(drawn[1][0], WINDOW) == []


def test_the_ranking_shows_gains_beside_their_thresholds(drawn: Drawn) -> None:
    figures.ranking_panels(diagnosis_of("explained"))
    axes = drawn[0][0]
    bars = [patch.get_width() for patch in axes.patches]
    assert bars == [347.0, 343.0, 0.0]
    assert [t.get_text() for t in axes.texts] == ["347", "343", "none"]
    assert [t.get_text() for t in axes.get_yticklabels()] == [
        "coulomb-friction (engine)",
        "viscous-friction (engine)",
        "hull-fouling (hull)",
    ]
    assert [tuple(line.get_xdata()) for line in axes.lines] == [(10.5, 10.5)] * 3
    assert axes.get_xlim() == (0.0, 347.0 * 1.8)
    from matplotlib.colors import to_hex

    assert [to_hex(p.get_facecolor()) for p in axes.patches][:2] == [AFTER, "#7fbcc5"]
    assert [p.get_alpha() for p in axes.patches] == [1.0, 1.0, 0.6]


def test_at_most_twelve_are_ranked_and_none_leaves_no_figure(drawn: Drawn) -> None:
    many = [(candidate("hull-fouling (hull)", 50.0 - i, 0.1), 10.5) for i in range(15)]
    figures.ranking_panels(diagnosis_of("nothing-missing", ranking=many))
    assert len(drawn[0][0].patches) == 12
    assert drawn[0][0].get_xlim() == pytest.approx((0.0, 57.5))  # small gains need less room
    assert figures.ranking_panels(diagnosis_of("nothing-missing", ranking=[])) == []


def test_rows_are_evenly_spaced() -> None:
    assert diagnosis_of("explained").interval_s == pytest.approx(0.2)
    assert figures.is_corrected(diagnosis_of("explained"))
    assert not figures.is_corrected(diagnosis_of("nothing-missing"))
