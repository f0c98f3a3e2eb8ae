"""Fixtures that many tests share."""

from __future__ import annotations

import os
from typing import Any

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

from shaftline.plant import Equilibrium, Ship, equilibrium, get_sea, load_ship, realise

# the same examples at every run, and no time limit on a noisy machine
settings.register_profile("shaftline", deadline=None, derandomize=True, max_examples=25)
settings.load_profile("shaftline")

# a worker a core: BLAS threads beside them would only wait for each other, as matrices are small
threadpool_limits(1, "blas")
# OpenMP has one thread in torch, which is imported later, and in the processes that tests start.
os.environ.setdefault("OMP_NUM_THREADS", "1")


BY_ENVIRONMENTS = tuple(
    f"tests/{folder}/" for folder in ("agents", "baselines", "envs", "observers", "plant")
)
"""Folders of tests that use the kernels of plant, observers and environments."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests that use the same kernels together.

    Each worker begins with its own part of the list. On a machine without compiled kernels two workers
    would otherwise compile the same kernels at the same time.
    """
    items.sort(key=lambda item: not item.nodeid.startswith(BY_ENVIRONMENTS))


@pytest.fixture(scope="session")
def frigate() -> Ship:
    return load_ship("frigate")


@pytest.fixture(scope="session")
def held_frigate(frigate: Ship) -> Ship:
    """The frigate, its shafts held at a speed by no matter what."""
    tree = frigate.model_dump(exclude_unset=True)
    tree["prime_mover"] = {"type": "speed-command", "speed_max_rad_s": 15.0}
    return Ship.model_validate(tree)


@pytest.fixture(scope="session")
def servo() -> Ship:
    """A drive with a load and no propeller: the least that a ship's file may say."""
    return Ship.model_validate(
        {
            "name": "servo",
            "hull": {"fixed": True},
            "propeller": {"model": "none"},
            "prime_mover": {"type": "torque-command", "torque_max_N_m": 200.0},
            "transmission": {
                "gear_ratio": 1.0,
                "efficiency": 1.0,
                "inertia_engine_side_kg_m2": 95.0,
                "inertia_propeller_side_kg_m2": 0.0,
                "viscous_friction_engine_side_N_m_s_rad": 190.0,
            },
            "integration": {"time_step_s": 0.001},
        }
    )


@pytest.fixture(scope="session")
def design_point(frigate: Ship) -> Equilibrium:
    """The thesis's base case: X = 22 mm, P/D = 1.4."""
    return equilibrium(frigate, 22.0, 1.4)


@pytest.fixture(scope="session")
def thesis_sea() -> Any:
    """One realisation of the thesis's sea; `simulate` works on a copy of it."""
    sea = get_sea("thesis")
    assert sea is not None
    return realise(sea, depth_m=4.0, seed=7)
