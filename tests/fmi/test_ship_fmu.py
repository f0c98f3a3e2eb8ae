"""A ship as an FMU computes what the simulation computes, to the last bit, and refuses other uses."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shaftline.fmi.archive import FmuError
from shaftline.fmi.description import base_unit
from shaftline.fmi.ship import export_ship
from shaftline.plant import (
    Schedule,
    Ship,
    equilibrium,
    get_sea,
    load_ship,
    realise,
    simulate,
    simulate_recording,
)
from shaftline.plant.columns import drive_column, signal_columns
from shaftline.plant.dynamics import settle_lags
from shaftline.plant.signals import SIGNALS
from shaftline.plant.state import Inputs

fmpy = pytest.importorskip("fmpy")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler named cc")

STATES = (
    "true_pitch_ratio",
    "true_shaft_speed_rad_s",
    "true_ship_speed_m_s",
    "ventilation",
    "shaft_angle_rad",
    "rudder_rad",
    "sway_speed_m_s",
    "yaw_rate_rad_s",
    "heading_rad",
    "cross_track_m",
    "position_m",
    "ship_speed_m_s",
)
"""Signals that do not depend on the commands of the same instant."""


def start_of(ship: Ship) -> Any:
    highest = float(ship.record()["drive_max"])
    signals = dict.fromkeys(ship.external_signals, 0.0)
    return equilibrium(ship, 0.6 * highest, ship.propeller.pitch_ratio_max, signals=signals)


def run(file: Path, table: pd.DataFrame, outputs: list[str], **more: Any) -> Any:
    """Simulate an FMU in FMPy with the columns of a table as inputs, held between rows."""
    names = ["time", *table.columns[1:]]
    inputs = np.array(list(map(tuple, table.to_numpy(float))), [(name, float) for name in names])
    interval = float(table["time_s"][1])
    return fmpy.simulate_fmu(
        str(file),
        stop_time=float(table["time_s"].iloc[-1]),
        output_interval=interval,
        input=inputs,
        output=outputs,
        set_input_derivatives=False,
        **more,
    )


def commands(ship: Ship, rows: int, interval_s: float) -> pd.DataFrame:
    """Commands that jump: the drive in the first half, then the pitch, and the rudder at the end."""
    point, k = start_of(ship), np.arange(rows)
    drive, pitch = point.inputs.drive, point.inputs.pitch_command
    table = {"time_s": k * interval_s}
    table[drive_column(ship)] = np.where((k > rows // 5) & (k < rows // 2), 1.3 * drive, drive)
    if ship.has_variable_pitch:
        table["pitch_ratio_command"] = np.where(k > 2 * rows // 3, 0.8 * pitch, pitch)
    if ship.turns:
        table["rudder_command_rad"] = np.where(k > rows // 3, 0.2, 0.0)
    return pd.DataFrame(table)


def changes(table: pd.DataFrame) -> Any:
    """Rows at which a command differs from that of the row before."""
    return (table.diff().iloc[:, 1:] != 0.0).any(axis=1).to_numpy() & (table.index > 0)


def shaped(name: str) -> Ship:
    """Return a ship; the frigate with an external signal, a term, and instruments with lag and delay."""
    ship = load_ship(name)
    if name != "frigate":
        return ship
    expression = "exp(0.1 * shaft_speed) * gust * bias"
    term = {
        "id": "gust",
        "acts_on": "load_torque",
        "expression": expression,
        "parameters": {"bias": 2.0},
    }
    keys = {"sensors.torque_delay_s": 0.3, "sensors.torque_lag_s": 0.8, "term": [term]}
    return ship.with_signals({"gust": "N m"}).with_values(keys)


@pytest.mark.parametrize(
    ("name", "per_row", "sea"),
    [
        ("frigate", 1, None),
        ("frigate-at-sea", 4, "hs=4,tp=9"),
        ("frigate-turning", 2, "hs=3,tp=8,heading=120"),
        ("rov-thruster", 1, None),
        ("tito-neri-sine", 3, None),
    ],
)
def test_an_fmu_equals_simulate_to_the_last_bit(
    name: str, per_row: int, sea: str | None, tmp_path: Path
) -> None:
    ship, file = shaped(name), tmp_path / "ship.fmu"
    point = start_of(ship)
    found = get_sea(sea or "calm")
    waves = realise(found, ship.propeller.depth_m, 3) if found else None
    export_ship(ship, point, file, waves)
    assert validate_fmu(str(file)) == []
    interval = per_row * ship.time_step_s
    table = commands(ship, 161, interval)
    if ship.signals:
        table["gust"] = 5e3
    first = {
        "pitch_ratio": point.state.pitch_ratio,
        "shaft_speed_rad_s": point.state.shaft_speed,
        "ship_speed_m_s": point.state.ship_speed,
    }
    recording = table.assign(**{k: float(v) for k, v in first.items()})
    expected = simulate_recording(ship, recording, waves, every_signal=True)
    outputs = [c for c in signal_columns(ship) if c not in table]
    result = run(file, table, outputs)
    assert len(result) == len(table)
    moved = changes(table)
    assert 2 <= moved.sum() <= 4
    for column in outputs:
        same = result[column] == expected[column].to_numpy()
        exact = same if column in STATES else same[~moved] if waves is None else same[-1:]
        assert np.all(exact), column
    assert np.ptp(result["true_shaft_speed_rad_s"]) > 0.1  # the commands do something
    # At each communication point the outputs are the last row of a simulation that ends there.
    for k in (1, int(np.flatnonzero(moved)[0]), 100):
        ends = simulate_recording(ship, recording[: k + 1], waves, every_signal=True).iloc[-1]
        assert [result[c][k] for c in outputs] == [ends[c] for c in outputs], k


@pytest.fixture(scope="module")
def frigate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("fmu") / "frigate.fmu"
    ship = load_ship("frigate")
    export_ship(ship, equilibrium(ship, 20.0, 1.2), file)
    return file


Make = Callable[..., Any]


@pytest.fixture
def make(frigate: Path, tmp_path: Path) -> Make:
    """Return a function that makes initialised instances with a dictionary of their variables."""
    description = fmpy.read_model_description(str(frigate))
    fmpy.extract(str(frigate), str(tmp_path / "unpacked"))
    said: list[str] = []

    def log(_: Any, __: Any, ___: int, ____: Any, text: bytes) -> None:
        said.append(text.decode())

    def instance(initialised: bool = True) -> Any:
        made = fmpy.simulation.instantiate_fmu(
            str(tmp_path / "unpacked"), description, "CoSimulation", logger=log
        )
        made.said, made.vr = said, {v.name: v.valueReference for v in description.modelVariables}
        made.setupExperiment(startTime=0.0)
        if initialised:
            made.enterInitializationMode()
            made.exitInitializationMode()
        return made

    return instance


def refused(instance: Any, call: Callable[[], Any], *words: str) -> None:
    with pytest.raises(Exception, match="failed"):
        call()
    for word in words:
        assert word in instance.said[-1], instance.said


def test_disturbances_act_as_in_a_simulation(frigate: Path) -> None:
    ship, rows = load_ship("frigate"), 81
    table = pd.DataFrame(
        {
            "time_s": np.arange(rows) * 0.05,
            "inflow_disturbance_m_s": 0.7,
            "surface_elevation_m": -0.4,
            "resistance_factor": 1.5,
        }
    )
    result = run(frigate, table, ["true_ship_speed_m_s", "thrust_N", "propeller_submergence_m"])
    schedule = Schedule(20.0, 1.2, inflow=0.7, elevation=-0.4, resistance_factor=1.5)
    samples = simulate(ship, schedule, 4.0, initial=equilibrium(ship, 20.0, 1.2).state)
    assert np.array_equal(result["true_ship_speed_m_s"], samples["ship_speed"])
    assert np.array_equal(result["thrust_N"], samples["measured_thrust"])
    assert np.array_equal(result["propeller_submergence_m"], samples["submergence"])


def test_lags_start_settled_on_the_disturbances(tmp_path: Path) -> None:
    ship, file = (
        load_ship("frigate").with_values({"propeller.inflow_lag_s": 2.0}),
        tmp_path / "ship.fmu",
    )
    point = equilibrium(ship, 20.0, 1.2)
    export_ship(ship, point, file)
    inputs = Inputs(20.0, 1.2, 0.7, elevation=-0.4)
    start = settle_lags(ship.record(), point.state, inputs)
    assert start.inflow != point.state.inflow
    table = pd.DataFrame(
        {
            "time_s": np.arange(41) * ship.time_step_s,
            "inflow_disturbance_m_s": 0.7,
            "surface_elevation_m": -0.4,
        }
    )
    result = run(file, table, ["advance_velocity_m_s"])
    schedule = Schedule(20.0, 1.2, inflow=0.7, elevation=-0.4)
    samples = simulate(ship, schedule, float(table["time_s"].iloc[-1]), initial=start)
    assert np.array_equal(result["advance_velocity_m_s"], samples["advance_velocity"])


def test_initial_speeds_are_parameters(frigate: Path) -> None:
    ship = load_ship("frigate")
    table = pd.DataFrame({"time_s": np.arange(81) * 0.05, "fuel_rack_mm": 20.0})
    values = {"initial_ship_speed_m_s": 4.0, "initial_shaft_speed_rad_s": 9.0}
    result = run(frigate, table, ["true_shaft_speed_rad_s"], start_values=values)
    start = equilibrium(ship, 20.0, 1.2).state._replace(ship_speed=4.0, shaft_speed=9.0)
    samples = simulate(ship, Schedule(20.0, 1.2), 4.0, initial=start)
    assert result["true_shaft_speed_rad_s"][0] == 9.0
    assert np.array_equal(result["true_shaft_speed_rad_s"], samples["shaft_speed"])


def test_outputs_follow_inputs_in_the_initialization_mode(make: Make) -> None:
    one = make(initialised=False)
    one.enterInitializationMode()
    torque, rack = [one.vr["brake_torque_N_m"]], [one.vr["fuel_rack_mm"]]
    (before,) = one.getReal(torque)
    one.setReal(rack, [25.0])
    (after,) = one.getReal(torque)
    assert after > 1.2 * before


def test_other_communication_steps_are_refused(make: Make) -> None:
    one = make()
    refused(
        one,
        lambda: one.doStep(0.0, 0.07),
        "communication step 0.07 s",
        "whole multiple of the time step of this FMU, 0.05 s",
        "such as 0.05 s",
    )
    refused(one, lambda: one.doStep(0.0, 0.02), "communication step 0.02 s")
    refused(one, lambda: one.doStep(0.0, -0.05), "communication step -0.05 s")
    one.doStep(0.0, 0.15)
    one.doStep(0.15, 0.05 * (1.0 + 1e-9))  # rounding of the master
    refused(one, lambda: one.doStep(0.05, 0.05), "from 0.05 s", "the FMU is at 0.2 s")


def test_values_that_cannot_be_set_are_refused(make: Make) -> None:
    one = make()
    rack = [one.vr["fuel_rack_mm"]]
    refused(one, lambda: one.setReal(rack, [np.nan]), "fuel_rack_mm = nan: must be a finite number")
    speed = [one.vr["initial_ship_speed_m_s"]]
    refused(one, lambda: one.setReal(speed, [1.0]), "initial_ship_speed_m_s is a fixed parameter")
    refused(one, lambda: one.setReal([one.vr["thrust_N"]], [1.0]), "is no input and no parameter")
    refused(one, lambda: one.getReal([999]), "value reference 999")


def test_a_simulation_that_diverges_says_so(make: Make) -> None:
    one = make()
    one.setReal([one.vr["inflow_disturbance_m_s"]], [1e9])
    refused(
        one, lambda: one.doStep(0.0, 5.0), "the simulation diverges at 5 s: ", "time step of 0.05"
    )


def test_a_stored_state_continues_as_if_nothing_had_happened(make: Make) -> None:
    one, other = make(), make()
    rack, speed = [one.vr["fuel_rack_mm"]], [one.vr["true_shaft_speed_rad_s"]]
    one.setReal(rack, [26.0])
    one.doStep(0.0, 1.0)
    kept = one.getFMUState()
    stored = one.serializeFMUState(kept)
    one.doStep(1.0, 1.0)
    expected = one.getReal(speed)
    one.setReal(rack, [10.0])
    one.doStep(2.0, 1.0)
    assert one.getReal(speed) != expected
    one.setFMUState(kept)
    one.doStep(1.0, 1.0)
    assert one.getReal(speed) == expected
    other.setFMUState(other.deserializeFMUState(stored))
    other.doStep(1.0, 1.0)
    assert other.getReal(speed) == expected


def test_instances_are_independent_and_can_be_reset(make: Make) -> None:
    one, other = make(), make()
    rack, speed = [one.vr["fuel_rack_mm"]], [one.vr["true_shaft_speed_rad_s"]]
    first = one.getReal(speed)
    one.setReal(rack, [30.0])
    one.doStep(0.0, 2.0)
    assert one.getReal(speed) != first == other.getReal(speed)
    one.reset()
    assert one.getReal(rack) == [20.0]
    one.setupExperiment(startTime=100.0)
    one.enterInitializationMode()
    one.exitInitializationMode()
    one.doStep(100.0, 0.05)
    assert one.getReal(speed)[0] == pytest.approx(first[0], rel=1e-6)


HOST = r"""
#include <dlfcn.h>
#include <stdio.h>
typedef struct { void *log, *allocate, *release, *finished, *environment; } callbacks;
int main(int count, char **names)
{
    void *fmu = dlopen(names[1], RTLD_NOW | RTLD_LOCAL);
    if (!fmu || count < 3) { puts(dlerror()); return 1; }
    callbacks none = {0};
    void *(*make)(const char *, int, const char *, const char *, const callbacks *, int, int) =
        (void *(*)(const char *, int, const char *, const char *, const callbacks *, int, int))
            dlsym(fmu, "fmi2Instantiate");
    int (*enter)(void *) = (int (*)(void *))dlsym(fmu, "fmi2EnterInitializationMode");
    int (*leave)(void *) = (int (*)(void *))dlsym(fmu, "fmi2ExitInitializationMode");
    int (*set)(void *, const unsigned *, size_t, const double *) =
        (int (*)(void *, const unsigned *, size_t, const double *))dlsym(fmu, "fmi2SetReal");
    int (*get)(void *, const unsigned *, size_t, double *) =
        (int (*)(void *, const unsigned *, size_t, double *))dlsym(fmu, "fmi2GetReal");
    int (*step)(void *, double, double, int) =
        (int (*)(void *, double, double, int))dlsym(fmu, "fmi2DoStep");
    if (make("x", 1, "another guid", "", &none, 0, 0)) return 2;
    void *one = make("x", 1, names[2], "", &none, 0, 0);
    unsigned rack = 0, speed = 19;
    double value = 26.0;
    if (!one || enter(one) || leave(one) || set(one, &rack, 1, &value)) return 3;
    if (step(one, 0.0, 2.0, 1)) return 4;
    get(one, &speed, 1, &value);
    printf("%.17g\n", value);
    return 0;
}
"""


def test_it_runs_in_a_program_without_python(frigate: Path, tmp_path: Path) -> None:
    (tmp_path / "host.c").write_text(HOST)
    host = tmp_path / "host"
    subprocess.run(["cc", str(tmp_path / "host.c"), "-ldl", "-o", str(host)], check=True)
    with zipfile.ZipFile(frigate) as members:
        (binary,) = (n for n in members.namelist() if n.startswith("binaries/linux64/"))
        library = members.extract(binary, tmp_path)
        assert load_ship(members.extract("resources/ship.toml", tmp_path)) == load_ship("frigate")
    description = fmpy.read_model_description(str(frigate))
    assert {v.name: v.valueReference for v in description.modelVariables}[
        "true_shaft_speed_rad_s"
    ] == 19
    done = subprocess.run(
        [str(host), library, description.guid], capture_output=True, text=True, check=False, env={}
    )
    assert done.returncode == 0, done.stdout
    ship = load_ship("frigate")
    start = equilibrium(ship, 20.0, 1.2).state
    memory = simulate(ship, Schedule(lambda t: 26.0 + 0.0 * t, 1.2), 2.0, initial=start)
    assert float(done.stdout) == memory["shaft_speed"][-1]


def test_the_description_follows_the_registry(frigate: Path) -> None:
    description = fmpy.read_model_description(str(frigate), validate_model_structure=True)
    variables = {v.name: v for v in description.modelVariables}
    signals = {s.column: s for s in SIGNALS}
    assert {n for n, v in variables.items() if v.causality == "output"} == {
        *signal_columns(load_ship("frigate"))
    } - {"time_s", "fuel_rack_mm", "pitch_ratio_command"}
    torque = variables["shaft_torque_N_m"]
    assert (torque.unit, torque.description) == ("N.m", signals["shaft_torque_N_m"].description)
    (unit,) = (u for u in description.unitDefinitions if u.name == "N.m")
    assert (unit.baseUnit.kg, unit.baseUnit.m, unit.baseUnit.s) == (1, 2, -2)
    (unit,) = (u for u in description.unitDefinitions if u.name == "mm")
    assert (unit.baseUnit.m, unit.baseUnit.factor) == (1, 0.001)
    rack = variables["fuel_rack_mm"]
    assert (rack.causality, rack.start, rack.max) == ("input", "20.0", "40.0")
    assert description.coSimulation.canGetAndSetFMUstate
    assert not description.coSimulation.needsExecutionTool
    assert description.defaultExperiment.stepSize == "0.05"


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("rad/s2", (1.0, {"rad": 1, "s": -2})),
        ("kg/s", (1.0, {"kg": 1, "s": -1})),
        ("g/s", (1e-3, {"kg": 1, "s": -1})),
        ("W", (1.0, {"kg": 1, "m": 2, "s": -3})),
        ("-", (1.0, {})),
        ("N.m", (1.0, {"kg": 1, "m": 2, "s": -2})),
        ("m/s/s", (1.0, {"m": 1, "s": -2})),
        ("furlong", None),
        ("m2", (1.0, {"m": 2})),
    ],
)
def test_base_units(unit: str, expected: Any) -> None:
    assert base_unit(unit) == expected


def test_every_unit_of_the_registry_has_base_units() -> None:
    assert not [s for s in SIGNALS if base_unit(s.unit) is None]


def test_equal_exports_are_equal_files(frigate: Path, tmp_path: Path) -> None:
    ship, again = load_ship("frigate"), tmp_path / "frigate.fmu"
    export_ship(ship, equilibrium(ship, 20.0, 1.2), again)
    assert again.read_bytes() == frigate.read_bytes()
    export_ship(ship, equilibrium(ship, 21.0, 1.2), again)
    guids = [fmpy.read_model_description(str(file)).guid for file in (again, frigate)]
    assert guids[0] != guids[1]


def test_without_a_compiler_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    ship = load_ship("frigate")
    with pytest.raises(FmuError, match="none of cc, gcc and clang was found"):
        export_ship(ship, start_of(ship), tmp_path / "ship.fmu")
    assert not list(tmp_path.iterdir())
