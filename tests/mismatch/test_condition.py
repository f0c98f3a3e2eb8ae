"""Statistics of a condition monitoring: rates of false alarms and detection, scatter, trends."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy

from shaftline.mismatch.condition import Estimated, baseline_of, change_of, trend_of

DRAWS = 4000


def drawn(
    rng: np.random.Generator, count: int, shift: float = 0.0, tau: float = 0.5
) -> list[Estimated]:
    """Estimates that scatter by tau between recordings beside their own errors, 0.2 to 0.6."""
    errors = rng.uniform(0.2, 0.6, count)
    values = 10.0 + shift + tau * rng.standard_normal(count) + errors * rng.standard_normal(count)
    return [Estimated(float(v), float(e)) for v, e in zip(values, errors, strict=True)]


@pytest.mark.parametrize(("count", "least"), [(3, 0.001), (8, 0.03)])
def test_the_rate_of_false_alarms_is_at_most_the_risk(count: int, least: float) -> None:
    """At most the stated 5 %, with three standard errors of the count of draws."""
    rng = np.random.default_rng(count)
    alarms = sum(
        change_of(baseline_of(drawn(rng, count)), drawn(rng, 1)[0], 0.05).alarm
        for _ in range(DRAWS)
    )
    assert least < alarms / DRAWS < 0.05 + 3.0 * math.sqrt(0.05 * 0.95 / DRAWS)


def test_a_change_of_the_detection_limit_is_found_in_nine_of_ten() -> None:
    rng = np.random.default_rng(4)
    found = 0
    for _ in range(DRAWS):
        normal = baseline_of(
            [Estimated(10.0 + 0.1 * rng.standard_normal(), 0.1) for _ in range(30)]
        )
        limit = change_of(normal, Estimated(10.0, 0.3), 0.01).detection_limit
        found += change_of(
            normal, Estimated(10.0 + limit + 0.3 * rng.standard_normal(), 0.3), 0.01
        ).alarm
    assert found / DRAWS == pytest.approx(0.9, abs=0.02)


def test_scatter_between_recordings_is_estimated() -> None:
    rng = np.random.default_rng(5)
    found = [baseline_of(drawn(rng, 40, tau=0.5)).scatter ** 2 for _ in range(200)]
    assert np.mean(found) == pytest.approx(0.25, rel=0.05)
    alike = baseline_of([Estimated(1.0, 0.1)] * 4)
    assert alike.scatter == 0.0
    assert alike.standard_error == pytest.approx(0.05)


def test_the_trend_is_the_weighted_line() -> None:
    times = [0.0, 10.0, 20.0, 40.0]
    estimates = [Estimated(1.0, 0.1), Estimated(1.3, 0.2), Estimated(1.2, 0.1), Estimated(2.1, 0.1)]
    errors = [r.standard_error for r in estimates]
    slope = np.polyfit(times, [r.value for r in estimates], 1, w=1.0 / np.array(errors))[0]
    found = trend_of(times, estimates, 0.0)
    assert found.slope == pytest.approx(slope)
    flat = trend_of(times, [Estimated(1.0, 0.1)] * 4, 0.0)
    spread = sum((t - 17.5) ** 2 for t in times) / 0.01
    assert flat.slope == pytest.approx(0.0, abs=1e-12)
    assert flat.half_95 == pytest.approx(scipy.stats.t.ppf(0.975, 2) / math.sqrt(spread))
