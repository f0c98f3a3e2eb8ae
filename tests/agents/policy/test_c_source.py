"""A policy as C source computes what the policy computes."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftline.agents.policy.c_source import c_source
from shaftline.agents.policy.policy import Policy, load_policy
from shaftline.baselines.controller import NORMALISED_BOUND
from shaftline.envs import FrigateVectorEnv

COMPILER = shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler named cc")


def in_double_precision(policy: Policy, x: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Actions of the network in NumPy's double precision."""
    network = policy.network
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        x = weight.astype(float) @ x + bias.astype(float)
        if k < len(network.weights) - 1:
            x = np.tanh(x) if network.activation == "tanh" else np.maximum(x, 0.0)
    return np.asarray(np.tanh(x) if network.squashed else np.clip(x, -1.0, 1.0))


@needs_compiler
@pytest.mark.parametrize("name", ["storm", "wave-preview"])
def test_the_compiled_file_equals_the_policy_along_an_episode(name: str, tmp_path: Path) -> None:
    policy = load_policy(name)
    (tmp_path / "policy.c").write_text(c_source(policy, "policy"))
    library = tmp_path / "policy.so"
    flags = ["-std=c99", "-Wall", "-Werror", "-O2", "-shared", "-fPIC"]
    assert COMPILER is not None
    subprocess.run(
        [COMPILER, *flags, str(tmp_path / "policy.c"), "-lm", "-o", str(library)], check=True
    )
    code = ctypes.CDLL(str(library))
    inputs, outputs = policy.network.shape
    memory, doubles = (ctypes.c_double * inputs)(), ctypes.POINTER(ctypes.c_double)
    code.policy_reset(memory)
    units = policy.interface | {"normalised": False}
    env = FrigateVectorEnv(1, task=name, observer="none", **units)
    observation, _ = env.reset(seed=3)
    scaled = FrigateVectorEnv(1, task=name, observer="none", **policy.interface)
    normalised, _ = scaled.reset(seed=3)
    middle, half = scaled.batch.observed_scale.astype(float)
    stack, state = np.zeros(inputs), None
    for step in range(30):
        measured = np.ascontiguousarray(observation[0], float)
        action = np.zeros(outputs)
        code.policy_step(memory, measured.ctypes.data_as(doubles), action.ctypes.data_as(doubles))
        bounded = np.clip((measured - middle) / half, -NORMALISED_BOUND, NORMALISED_BOUND)
        stack = np.concatenate([stack[len(measured) :], bounded])
        assert action == pytest.approx(in_double_precision(policy, stack), abs=1e-12), step
        single, state = policy.predict(normalised, state)
        assert action == pytest.approx(single[0], abs=2e-4), step
        observation, *_ = env.step(single)
        normalised, *_ = scaled.step(single)


def test_the_file_names_its_measurements_and_actions() -> None:
    text = c_source(load_policy("storm"), "storm")
    assert " *   5: measured_ship_speed [m/s], measurement of the speed log" in text
    assert "void storm_step(storm_state *state, const double measurements[17]" in text
    assert " *   1: drive: fuel rack [mm], which idle speed" in text


def test_a_name_that_is_no_c_identifier_is_refused() -> None:
    with pytest.raises(ValueError, match="'9a' is no name of a C function"):
        c_source(load_policy("storm"), "9a")
