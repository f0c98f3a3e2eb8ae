"""Feedback loops: margins against closed forms, sampling, opening a loop of several readings."""

from __future__ import annotations

import math

import control
import numpy as np
import pytest

from shaftline.plant.loops import Loop, drop_unconnected_states, loop_at_command, sample_plant


def test_margins_of_a_third_order_loop_are_those_of_the_textbook() -> None:
    """K / (s + 1)^3: phase -180 deg at sqrt(3), where |L| = K / 8."""
    loop = Loop.from_plant(control.tf([4.0], [1.0, 3.0, 3.0, 1.0]), control.tf([1.0], [1.0]))
    margins = loop.margins()
    assert margins.gain_margin_dB == pytest.approx(20.0 * math.log10(2.0), abs=1e-9)
    assert margins.phase_crossover == pytest.approx(math.sqrt(3.0), rel=1e-9)
    crossover = math.sqrt(4.0 ** (2.0 / 3.0) - 1.0)
    assert margins.crossover == pytest.approx(crossover, rel=1e-9)
    phase = 180.0 - 3.0 * math.degrees(math.atan(crossover))
    assert margins.phase_margin_deg == pytest.approx(phase, rel=1e-9)
    assert margins.delay_margin == pytest.approx(math.radians(phase) / crossover, rel=1e-9)
    assert math.isinf(margins.gain_margin_down_dB)
    least = np.min(np.abs(1.0 + loop.response(np.geomspace(0.1, 10.0, 20000))))
    assert margins.peak_sensitivity == pytest.approx(1.0 / least, rel=1e-4)


def test_a_loop_that_needs_its_gain_has_a_margin_downwards() -> None:
    """2 / (s - 1): 1 would be too little, so the gain may fall by a half."""
    loop = Loop.from_plant(control.tf([2.0], [1.0, -1.0]), control.tf([1.0], [1.0]))
    assert loop.stable
    found = Loop(control.tf([2.0], [1.0, -1.0]) * control.tf([1.0], [0.01, 1.0])).margins()
    assert found.gain_margin_dB > 20.0
    assert not Loop(control.tf([0.9], [1.0, -1.0])).stable
    conditional = Loop(
        control.tf([60.0, 60.0], [1.0, 2.0, -3.0, 0.0])
    )  # (s + 1) / s (s + 3) (s - 1)
    assert conditional.stable
    down = conditional.margins().gain_margin_down_dB
    least = 60.0 * 10.0 ** (-down / 20.0)
    for factor, holds in ((1.001, True), (0.999, False)):
        gain = factor * least
        assert Loop(control.tf([gain, gain], [1.0, 2.0, -3.0, 0.0])).stable is holds


def test_an_unstable_loop_has_no_margins() -> None:
    loop = Loop(control.tf([9.0], [1.0, 3.0, 3.0, 1.0]))
    assert not loop.stable
    with pytest.raises(ValueError, match="unstable"):
        loop.margins()
    with pytest.raises(ValueError, match="unstable"):
        loop.step_measures()
    with pytest.raises(ValueError, match="one input and one output, not 2 and 2"):
        Loop(control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))))


def test_what_an_unstable_loop_lacks() -> None:
    """1 / (s + 1)^3 with the gain K: the limit is K = 8, and the phase at |L| = 1 is -3 atan(w)."""
    plant = control.tf([1.0], [1.0, 3.0, 3.0, 1.0])
    loop = Loop.from_plant(plant, control.tf([80.0], [1.0]))
    lacking = loop.lacking_margins()
    assert lacking.gain_margin_dB == pytest.approx(-20.0, abs=1e-6)
    crossover = math.sqrt(80.0 ** (2.0 / 3.0) - 1.0)
    phase = 180.0 - 3.0 * math.degrees(math.atan(crossover))
    assert lacking.phase_margin_deg == pytest.approx(phase, abs=1e-6)
    assert phase < 0.0
    # (s + 1)^3 = -80
    pole = 80.0 ** (1.0 / 3.0) * np.exp(1j * math.pi / 3.0) - 1.0
    assert (loop.fastest_pole.real, abs(loop.fastest_pole.imag)) == pytest.approx(
        (pole.real, pole.imag)
    )
    always = Loop.from_plant(control.tf([1.0], [1.0, -1.0, 0.0]), control.tf([1.0], [1.0]))
    assert math.isnan(always.lacking_margins().gain_margin_dB)
    with pytest.raises(ValueError, match="the closed loop is stable"):
        Loop.from_plant(plant, control.tf([4.0], [1.0])).lacking_margins()


def test_step_of_a_second_order_loop() -> None:
    """L = 1 / (s (s + 2 z)) closes to 1 / (s^2 + 2 z s + 1)."""
    damping = 0.4
    measures = Loop(control.tf([1.0], [1.0, 2.0 * damping, 0.0])).step_measures()
    root = math.sqrt(1.0 - damping**2)
    assert measures.overshoot_percent == pytest.approx(
        100.0 * math.exp(-math.pi * damping / root), rel=1e-4
    )
    assert measures.peak == pytest.approx(math.pi / root, rel=1e-3)
    assert measures.last_value == pytest.approx(1.0)


def test_intervals_cost_half_of_themselves_in_phase() -> None:
    """An integrator under a gain every h: crossover near the gain, phase lag of h / 2 times it."""
    gain, interval = 0.5, 0.1
    law = control.ss([], [], [], [[gain]], interval)
    loop = Loop.from_plant(control.tf([1.0], [1.0, 0.0]), law)
    assert loop.interval == interval
    margins = loop.margins()
    lag = math.degrees(0.5 * margins.crossover * interval)
    assert margins.phase_margin_deg == pytest.approx(90.0 - lag, abs=1e-6)
    # unstable from gain 2 / h on, where the pole 1 - gain h leaves the circle
    assert margins.gain_margin_dB == pytest.approx(
        20.0 * math.log10(2.0 / interval / gain), abs=1e-6
    )


def test_what_follows_at_once_is_read_an_interval_late() -> None:
    plant = control.ss(
        [[-1.0]],
        [[1.0, 0.0]],
        [[1.0], [0.0]],
        [[0.0, 0.0], [0.0, 3.0]],
        inputs=["slow", "prompt"],
        outputs=["state", "echo"],
    )
    held = sample_plant(plant, 0.5)
    assert not np.any(held.D)
    time, forced = np.arange(4) * 0.5, np.array([[0.0] * 4, [1.0, 2.0, 4.0, 8.0]])
    outputs = control.forced_response(held, time, forced).outputs
    np.testing.assert_allclose(outputs[1], [0.0, 3.0, 6.0, 12.0], atol=1e-12)
    forced = np.array([[1.0] * 4, [0.0] * 4])
    outputs = control.forced_response(held, time, forced).outputs
    np.testing.assert_allclose(outputs[0], 1.0 - np.exp(-time), atol=1e-12)
    assert held.input_labels == ["slow", "prompt"]


def test_what_no_input_moves_or_no_output_shows_is_left_out() -> None:
    whole = control.ss(
        [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -2.0]],
        [[1.0], [0.0], [0.0]],
        [[1.0, 0.0, 5.0]],
        [[0.0]],
    )
    kept = drop_unconnected_states(whole)
    assert kept.nstates == 1
    assert complex(kept(0.3j)) == pytest.approx(complex(whole(0.3j)))


def test_a_loop_is_opened_at_one_command_with_the_inner_one_closed() -> None:
    """u = -2 w + 3 (r - y): opened at u, L = 2 W + 3 Y; closed, y follows r with 3 Y / (1 + L)."""
    plant = control.ss(
        [[-1.0, 0.0], [1.0, 0.0]],
        [[1.0], [0.0]],
        np.eye(2),
        np.zeros((2, 1)),
        inputs=["u"],
        outputs=["w", "y"],
    )
    law = control.ss([], [], [], [[3.0, -2.0, -3.0]], inputs=["r", "w", "y"], outputs=["u"])
    loop = loop_at_command(plant, law, "u", "r", "y")
    point = 0.7j
    w, y = 1.0 / (point + 1.0), 1.0 / (point * (point + 1.0))
    assert complex(loop.open_loop(point)) == pytest.approx(2.0 * w + 3.0 * y)
    assert complex(loop.closed_loop(point)) == pytest.approx(3.0 * y / (1.0 + 2.0 * w + 3.0 * y))
    for bad, kind in (
        (("x", "r", "y"), "command"),
        (("u", "x", "y"), "set-point"),
        (("u", "r", "x"), "measurement"),
    ):
        with pytest.raises(ValueError, match=f"unknown {kind} 'x'"):
            loop_at_command(plant, law, *bad)
