"""A policy as an FMU computes the actions of its C source."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from shaftline.agents.policy.fmu import export_policy
from shaftline.agents.policy.policy import load_policy
from shaftline.baselines.controller import NORMALISED_BOUND

from .test_c_source import in_double_precision

fmpy = pytest.importorskip("fmpy")
validate_fmu = pytest.importorskip("fmpy.validation").validate_fmu
pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler named cc")


def test_the_fmu_equals_the_network_over_stacked_observations(tmp_path: Path) -> None:
    policy, file = load_policy("storm"), tmp_path / "storm.fmu"
    export_policy(policy, file)
    assert validate_fmu(str(file)) == []
    description = fmpy.read_model_description(str(file))
    names: dict[str, list[str]] = {v.causality: [] for v in description.modelVariables}
    for variable in description.modelVariables:
        names[variable.causality].append(variable.name)
    assert names["output"] == ["pitch_ratio_action", "drive_action"]
    assert names["input"][:3] == ["speed_order_m_s", "shaft_speed_rad_s", "shaft_torque_N_m"]
    middle, half = policy.make_batch().observed_scale.astype(float)
    width, rows = len(middle), 12
    seen = middle + half * np.random.default_rng(1).uniform(-4.0, 4.0, (rows, width))
    inputs = np.zeros(rows, [("time", float), *((name, float) for name in names["input"])])
    inputs["time"] = 0.5 * np.arange(rows)
    for k, name in enumerate(names["input"]):
        inputs[name] = seen[:, k]
    result = fmpy.simulate_fmu(
        str(file),
        stop_time=0.5 * rows,
        output_interval=0.5,
        input=inputs,
        output=names["output"],
        set_input_derivatives=False,
    )
    assert [result[name][0] for name in names["output"]] == [0.0, 0.0]  # before the first step
    stack = np.zeros(policy.frames * width)
    for k, row in enumerate(seen):
        bounded = np.clip((row - middle) / half, -NORMALISED_BOUND, NORMALISED_BOUND)
        stack = np.concatenate([stack[width:], bounded])
        actions = [result[name][k + 1] for name in names["output"]]
        assert actions == pytest.approx(in_double_precision(policy, stack), abs=1e-12), k


def test_it_contains_its_source_and_compiles_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "rough-sea.fmu"
    export_policy(load_policy("rough-sea"), file)
    description = fmpy.read_model_description(str(file))
    assert description.coSimulation.modelIdentifier == "rough_sea"
    (configuration,) = description.buildConfigurations
    (sources,) = configuration.sourceFileSets
    assert sources.sourceFiles == ["slave.c"]
    folder = fmpy.extract(str(file), str(tmp_path / "unpacked"))
    assert {p.name for p in Path(folder, "sources").iterdir()} == {"slave.c", "policy.c", "model.h"}
