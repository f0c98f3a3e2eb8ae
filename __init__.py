"""shaftline: a workbench for ship propulsion control.

Public packages:

- ``shaftline.plant``      physics: propeller, prime movers, shaft, hull, actuators, waves
- ``shaftline.observers``  estimators of the advance velocity and of parameters
- ``shaftline.baselines``  classic controllers
- ``shaftline.envs``       Gymnasium environments, tasks and rewards
- ``shaftline.agents``     learned policies: training, policy files, evaluation
- ``shaftline.mismatch``   diagnosis: recordings compared with the simulation

Supporting packages:

- ``shaftline.core``       compiled kernels, atomic files, sweeps over cores and clusters
- ``shaftline.display``    tables and figures
- ``shaftline.validation`` validation of the diagnosis on concealed effects
- ``shaftline.cli``        the ``shaftline`` command
"""

import sys as _sys
from pathlib import Path as _Path


def _refuse_import_by_accident() -> None:
    """Refuse a checkout that is found only because a program runs in the folder that contains it.

    The root of a checkout is the package directory. In the folder above a checkout named ``shaftline``,
    Python would therefore prefer the checkout to the installed package, without any notice.

    Raises:
        ImportError: the checkout was found beside the running script or in the current directory.
    """
    here = _Path(__file__).parent
    if not (here / "pyproject.toml").is_file():
        return  # an installed package
    from os import environ, pathsep

    above = here.parent.resolve()
    chosen = [
        _Path(entry).resolve() for entry in environ.get("PYTHONPATH", "").split(pathsep) if entry
    ]
    beside = bool(_sys.path) and _Path(_sys.path[0]).resolve() == above
    if not beside or above in chosen:
        return
    from importlib.metadata import PackageNotFoundError, distribution  # takes time to import

    try:
        note = distribution("shaftline").read_text("direct_url.json") or ""
    except PackageNotFoundError:
        note = ""
    if here.resolve().as_uri() not in note:
        raise ImportError(
            f"{here} is a checkout of shaftline, found only because this program runs in {above}. "
            f"Install the checkout with `pip install -e {here}`, or run the program in another folder."
        )


_refuse_import_by_accident()
