"""Propellers and forms of the engine map for the ferry of the CPP optimiser paper."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
import scipy
from numpy.typing import NDArray

from reproductions.ferry import experiment, map_forms, propellers, similarity
from reproductions.ferry.bounded import bounded_least_squares
from reproductions.ferry.experiment import RISE
from reproductions.ferry.levers import table_cells
from reproductions.ferry.map_forms import FORMS, OPTIMA
from reproductions.ferry.similarity import AT_HELD, BEFORE, BY_TABLE_2, PLAIN, STATED
from shaftline.baselines.steady_points import steady_point
from shaftline.plant import load_ship

SHIP = load_ship("ferry-printed")
PRINTS = similarity.read_prints()
ONE = similarity.make_propellers([(SHIP.propeller.blades, SHIP.propeller.expanded_area_ratio)])
ALL = np.ones(5, dtype=bool)


@pytest.fixture(scope="module")
def groups() -> similarity.Groups:
    return similarity.calibrate(ONE, PRINTS)


@pytest.fixture(scope="module")
def field(groups: similarity.Groups) -> map_forms.Field:
    return map_forms.make_field(ONE, groups, PRINTS)


def test_the_groups_are_those_of_the_plant() -> None:
    """Speed, pitch angle and power of the plant at the states of Table 1, from two numbers."""
    own = similarity.groups_of(SHIP, np.full((1, 5), RISE))
    angles = similarity.printed_angles(ONE, own, PRINTS)[0]
    speeds = similarity.speeds_at_held_pitch(ONE, own, PRINTS)[0]
    power = similarity.powers(ONE, own, PRINTS.engine, PRINTS.ship_speed)[0]
    gear = SHIP.transmission.gear_ratio
    for lever in range(5):
        shaft = PRINTS.engine[BEFORE, lever] * math.pi / 30.0 / gear
        speed = PRINTS.ship_speed[BEFORE, lever]
        pitch = experiment.pitch_for(SHIP, shaft, speed, 1.0)
        assert angles[BEFORE, lever] == pytest.approx(experiment.blade_angle(pitch), abs=1e-6)
        raised = steady_point(SHIP, shaft, pitch, RISE)
        assert speeds[lever] == pytest.approx(raised.ship_speed, abs=1e-7)
        calm = steady_point(SHIP, shaft, pitch, 1.0)
        # The ship file is rounded: full power at 13 kn is 100 kW within 0.1 %.
        assert power[BEFORE, lever] == pytest.approx(
            calm.brake_torque * gear * shaft / 1e5, rel=1e-3
        )


def test_the_ship_file_has_the_calibrated_propeller(groups: similarity.Groups) -> None:
    found = similarity.particulars(ONE, groups, SHIP)
    assert SHIP.propeller.diameter_m == pytest.approx(found.diameter, rel=1e-4)
    assert SHIP.transmission.gear_ratio == pytest.approx(found.gear_ratio, rel=2e-4)
    drag = SHIP.hull.resistance_coefficient_N_s2_m2
    assert drag == pytest.approx(found.resistance_coefficient, rel=1e-4)
    assert SHIP.hull.resistance_exponent == pytest.approx(float(groups.exponent[0]), abs=5e-4)
    assert SHIP.hull.resistance_reference_speed_m_s == similarity.REFERENCE_SPEED


def test_the_exponent_is_that_of_table_2_at_one_lever() -> None:
    """By hand: 1.15 = (5.98 / 5.68)^k at lever 3."""
    assert similarity.exponent_of_lever(PRINTS) == pytest.approx(
        math.log(1.15) / math.log(5.98 / 5.68)
    )
    held = similarity.speeds_at_held_thrust(similarity.calibrate(ONE, PRINTS), PRINTS)[0]
    off = held - PRINTS.ship_speed[AT_HELD]
    assert off.tolist() == pytest.approx([-0.019, 0.0, 0.0, 0.019, 0.039], abs=1e-3)


def test_any_lever_predicts_table_1_at_the_others() -> None:
    found = propellers.calibrated_levers(PRINTS, SHIP)
    assert (found["T1 speed, worst other [m/s]"] < 0.007).all()
    assert (found["T2 speed, worst other [m/s]"] > 0.03).all()


def test_the_propeller_of_the_ferry_slows_too_little() -> None:
    hull = propellers.earlier_hull(PRINTS)
    assert (hull.speed_off > 0.055).all()
    assert np.allclose(hull.held_off, 0.0)
    rise = hull.groups[0].rise[0]
    assert rise.tolist() == pytest.approx([1.1003, 1.1084, 1.1084, 1.1158, 1.1228], abs=1e-4)


def test_wake_and_blades_leave_the_speeds_as_they_are() -> None:
    found = propellers.equal_ferries(PRINTS, SHIP)
    assert found["T1 speed, worst [m/s]"].max() < 0.006
    by_wake = found.groupby("wake fraction")["diameter [m]"].mean()
    ratio = by_wake.iloc[-1] / by_wake.iloc[0]
    assert ratio == pytest.approx(0.8**-1.5)  # power D^2 v_a^3 / J^3 at a given J


def test_fit_groups_finds_the_numbers_of_a_made_up_ferry() -> None:
    """Pitches that a propeller would have are fitted exactly, with its zero."""
    truth = similarity.Groups(
        np.array([0.55]), np.array([0.17]), np.array([2.5]), np.full((1, 5), RISE)
    )
    pitch = similarity.printed_angles(ONE, truth, PRINTS)[0] - 27.0
    made_up = PRINTS._replace(pitch=pitch)
    weights = np.ones((1, 4, 5))
    weights[0, :, 4] = 0.0
    found, zero = similarity.fit_groups(ONE, truth.exponent, STATED, made_up, weights)
    assert found.advance == pytest.approx(truth.advance, rel=1e-6)
    assert found.load == pytest.approx(truth.load, rel=1e-6)
    assert zero[0] == pytest.approx(27.0, abs=1e-6)
    held = similarity.rises(BY_TABLE_2, truth.exponent, PRINTS)[0]
    assert held[0] == pytest.approx((5.57 / 5.31) ** 2.5)


@pytest.mark.parametrize("name", FORMS)
def test_a_form_finds_its_own_map(name: str, field: map_forms.Field) -> None:
    """Consumption made by a form is fitted by it; the derivatives of the fuel are right."""
    form = FORMS[name]
    rough = map_forms.fit_maps(form, field, PRINTS, 0.0, 1e-3, ALL)
    made_up = PRINTS._replace(consumption=rough.consumption(field.power, field.speed)[0])
    fit = map_forms.fit_maps(form, field, made_up, 0.0, 1e-8, ALL)
    off = fit.consumption(field.power, field.speed)[0] - made_up.consumption
    assert np.abs(off).max() < 1e-3
    terms = form.evaluate(field.power, np.broadcast_to(field.speed, field.power.shape))
    assert terms.shape[-1] == form.coefficients == int(name.split(", ")[-1])


def test_the_weight_of_the_optima_makes_optima(field: map_forms.Field) -> None:
    form = FORMS["cubic of logarithms, 10"]
    worst = []
    for weight in (0.0, 10.0):
        fit = map_forms.fit_maps(form, field, PRINTS, weight, 1e-3, ALL)
        found = map_forms.judge(fit, field, PRINTS)
        worst.append(float(np.abs(found.engine[:, OPTIMA]).max()))
    assert worst[1] < 15.0 < worst[0]
    assert found.saving[0].tolist() == pytest.approx([3.2, 3.4, 3.2, 2.7, 2.9], abs=0.15)
    implied = map_forms.implied_saving(field, PRINTS)[0]
    assert implied.tolist() == pytest.approx([3.8, 3.5, 2.9, 2.7, 3.0], abs=0.05)


def test_a_lever_that_is_left_out_is_not_used(field: map_forms.Field) -> None:
    used = ALL.copy()
    used[1] = False
    wrong = PRINTS.consumption.copy()
    wrong[:, 1] += 50.0
    form, found = FORMS["the paper's, 12"], []
    for prints in (PRINTS, PRINTS._replace(consumption=wrong)):
        fit = map_forms.fit_maps(form, field, prints, 10.0, 1e-3, used)
        found.append(fit.consumption(field.power, field.speed))
    assert np.array_equal(found[0], found[1])


def test_a_willans_line_with_friction_falls_with_the_load_at_constant_speed(
    field: map_forms.Field,
) -> None:
    """The printed consumption of Table 1 rises with the load, at the same engine speed."""
    assert (field.power[0, PLAIN] > field.power[0, BEFORE]).all()
    assert (PRINTS.consumption[PLAIN] > PRINTS.consumption[BEFORE] + 9.0).all()


def test_tolerances_of_the_variations_are_those_of_the_levers() -> None:
    rows = experiment.compare_controls(SHIP)
    cells = table_cells(rows[rows["curve"] == "printed"], SHIP)
    wanted = propellers.variation_tolerances()
    for cell in cells:
        if cell.row.endswith("variation") and cell.column == "sfoc_g_kwh":
            table, lever = int(cell.table[-1]) - 1, int(cell.row[6]) - 1
            assert cell.high - cell.printed == pytest.approx(wanted[table, lever])


def test_the_front_has_no_beaten_combination() -> None:
    names = list(propellers.OBJECTIVES)
    rows = [(0.01, 1.0, 5.0), (0.02, 2.0, 9.0), (0.02, 0.5, 9.0), (0.01, 1.0, 5.0)]
    front = propellers.pareto_front(pd.DataFrame(rows, columns=names))
    assert front[names].to_numpy().tolist() == [[0.01, 1.0, 5.0], [0.02, 0.5, 9.0]]


def test_bounded_least_squares_is_the_constrained_minimum() -> None:
    random = np.random.default_rng(3)
    rows, aims = random.normal(size=(20, 3)), random.normal(size=20)
    limits = random.normal(size=(5, 3))
    least = limits @ random.normal(size=3)
    found = bounded_least_squares(rows, aims, limits, least)
    assert (limits @ found - least).min() > -1e-9

    def error(x: NDArray[np.float64]) -> float:
        return float(((rows @ x - aims) ** 2).sum())

    inside = scipy.optimize.LinearConstraint(limits, least, np.full(5, np.inf))
    other = scipy.optimize.minimize(error, np.zeros(3), constraints=inside, tol=1e-12)
    assert found == pytest.approx(other.x, abs=1e-5)
    with pytest.raises(ValueError, match="no coefficients"):
        bounded_least_squares(rows, aims, np.vstack([limits, -limits]), np.ones(10))
