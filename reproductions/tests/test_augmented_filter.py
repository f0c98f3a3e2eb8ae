"""The augmented filter's study: the falling body, the frigate, the page."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from reproductions.augmented_filter import falling_body, frigate, page

# -- the falling body --------------------------------------------------------------------------


def test_the_body_falls_as_scipy_says() -> None:
    """Gelb's equations written once more: g, and rho v^2 / (2 beta) with the density at its height."""

    def gelb(t: float, x: Any) -> list[float]:
        return [x[1], 3.4e-3 * math.exp(-x[0] / 22e3) * x[1] ** 2 / (2.0 * 3000.0) - 32.2]

    fall = falling_body.simulate_fall(3000.0, 0, 0.05, 0.0)
    theirs = solve_ivp(
        gelb, (0.0, 16.0), [100_100.0, -5650.0], t_eval=fall["time_s"], rtol=1e-10, atol=1e-6
    )
    assert fall["height_ft"].to_numpy() == pytest.approx(theirs.y[0], rel=1e-5)


@pytest.mark.parametrize(
    ("beta", "printed"),
    [(3000.0, [1.432, 0.0154, 0.0286, 0.0122]), (2000.0, [1.294, 0.00453, 0.0094, 0.0103])],
)
def test_with_exact_measurements_all_limits_hold(beta: float, printed: list[float]) -> None:
    """The first row of each truth in docs/results/augmented-filter.md."""
    fall = falling_body.simulate_fall(beta, 0, 0.05, 0.0)
    errors = falling_body.largest_errors(fall, beta)
    assert errors == pytest.approx(printed, rel=0.01)
    assert np.all(errors < [*falling_body.LIMITS.values()])
    deviation = fall.set_index("time_s")["beta_sd"]
    assert deviation.iloc[0] == pytest.approx(500.0, rel=1e-3)
    # beta is observable in dense air only: compare 5 s and 16 s
    assert deviation.iloc[99] > 0.99 * 500.0
    assert deviation.iloc[-1] < 0.02 * beta


# -- all of it, in small -----------------------------------------------------------------------


def test_results_and_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "FALLS", {"exact measurements": (0.05, 0.0, 1)})
    monkeypatch.setattr(frigate, "SEEDS", (1,))
    monkeypatch.setattr(frigate, "SECONDS", 120.0)
    monkeypatch.setattr(frigate, "GROWTH", ([0.0, 300.0, 900.0, 1200.0], [0.0, 0.0, 0.2, 0.2]))
    grown = frigate.follow_growth("calm", 1)
    monkeypatch.setattr(frigate, "follow_growth", lambda sea, seed: grown)
    monkeypatch.setattr(frigate, "estimate_friction_online", lambda sea, seed: (6031.0, 551.0))
    ticks: list[None] = []
    found = page.compute_results(lambda: ticks.append(None))
    assert len(ticks) == 2 * 1 + 2 * (1 + 1)
    told = found.identified.set_index(["sea", "key"])
    for key, truth in frigate.CONCEALED.items():
        assert told.loc[("calm", key), "found"] == pytest.approx(truth, rel=0.02)
    growing = found.growth["calm"]
    settled = growing[growing["time_s"] > 900.0]
    assert settled["filter"].to_numpy() == pytest.approx(settled["truth"], abs=0.02)
    text = page.body(found)
    assert "| 3000 | exact measurements | 1 | 1.4 | 1.5 % | 2.9 % | 1.2 % |" in text
    assert "6031 N m, standard deviation 551" in text
    assert len(page.figure(found).axes) == 3
