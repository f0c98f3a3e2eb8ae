"""Build an FMU: compile its binary for this platform and write the archive."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..core.files import write_atomically
from .description import Variable, model_description

_PLATFORMS = {
    "linux": ("linux64", ".so"),
    "darwin": ("darwin64", ".dylib"),
    "win32": ("win64", ".dll"),
}
_COMPILERS = ("cc", "gcc", "clang")


class FmuError(ValueError):
    """An FMU that cannot be written or used; the message says why."""


class Model(NamedTuple):
    """Model behind the co-simulation interface of ``slave.c``, which describes the functions."""

    description: str
    variables: Sequence[Variable]
    step_s: float  # time step [s]
    starts: Sequence[float]  # start value of each slot, slots of inputs and parameters first
    inputs: int  # number of slots of inputs
    settable: int  # number of slots of inputs and parameters
    code: str  # C: the type model_memory, the functions model_begin and model_advance
    sources: Mapping[str, str] = {}  # C files that the code includes
    machine_code: bytes = b""  # object file that the code calls
    resources: Mapping[str, str] = {}  # text files to include


def write_fmu(path: Path, model: Model) -> None:
    """Write a model as an FMU for co-simulation by FMI 2.0, with a binary for this platform.

    Without machine code the archive also has the C sources, so it can be compiled for other platforms.

    Raises:
        FmuError: the name of the file does not end in ``.fmu``, or no C compiler works here.
    """
    if path.suffix != ".fmu":
        raise FmuError(f"{path}: the name of an FMU must end in .fmu")
    identifier = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    identifier = f"_{identifier}" if identifier[0].isdigit() else identifier
    sources = {"slave.c": c_file("slave.c"), **model.sources}
    content = [*sources.values(), repr(model._replace(sources={}, resources={}))]
    guid = hashlib.sha256("".join(content).encode()).hexdigest()[:32]
    sources["model.h"] = _header(model, guid)
    folder, ending = _PLATFORMS.get(sys.platform, ("", ""))
    if not folder:
        raise FmuError(f"FMUs cannot be built on the platform {sys.platform}")
    portable = () if model.machine_code else ("slave.c",)
    description = model_description(
        identifier,
        guid,
        model.description,
        model.variables,
        model.step_s,
        version("shaftline"),
        portable,
    )
    members = {
        "modelDescription.xml": description,
        f"binaries/{folder}/{identifier}{ending}": _compile(sources, model.machine_code),
        **{f"resources/{name}": text.encode() for name, text in model.resources.items()},
    }
    if portable:
        members |= {f"sources/{name}": text.encode() for name, text in sources.items()}

    def write(file: Path) -> None:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in members.items():  # The fixed date makes equal exports equal files.
                archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)

    write_atomically(path, write)


def _header(model: Model, guid: str) -> str:
    names = {variable.slot: variable.name for variable in model.variables}
    count = len(model.starts)
    starts = ", ".join(repr(float(value)) for value in model.starts)
    texts = ", ".join(f'"{names.get(slot, "")}"' for slot in range(count))
    return f"""\
#define MODEL_GUID "{guid}"
#define MODEL_STEP_S {model.step_s!r}
#define MODEL_INPUTS {model.inputs}
#define MODEL_SETTABLE {model.settable}
#define MODEL_SLOTS {count}
static const double model_start[] = {{{starts}}};
static const char *const model_names[] = {{{texts}}};
{model.code}"""


def _compile(sources: Mapping[str, str], machine_code: bytes) -> bytes:
    """Return the shared library of ``slave.c``, all that it includes, and an object file."""
    named = os.environ.get("CC", "")
    compiler = next(filter(None, map(shutil.which, filter(None, (named, *_COMPILERS)))), None)
    if compiler is None:
        raise FmuError(
            "an FMU needs a C compiler, but none of cc, gcc and clang was found; install one, or name "
            "one by the environment variable CC"
        )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "machine.o").write_bytes(machine_code)
        parts = ["slave.c", *(["machine.o"] if machine_code else [])]
        complete = ["-Wl,-z,defs"] if sys.platform == "linux" else []  # elsewhere by default
        command = [
            compiler,
            "-std=c99",
            "-O2",
            "-shared",
            "-fPIC",
            "-fvisibility=hidden",
            *complete,
            "-o",
            "fmu",
            *parts,
            "-lm",
        ]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            raise FmuError(f"{compiler} cannot compile the FMU: {done.stderr.strip()[-500:]}")
        return (folder / "fmu").read_bytes()


def c_file(name: str) -> str:
    """Return the text of a C file of this package."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def c_bytes(name: str, data: bytes) -> str:
    """Return C text of a constant with these bytes, aligned as doubles."""
    words = np.frombuffer(data + bytes(-len(data) % 8), np.uint64)
    rows = [
        ", ".join(f"{word:#x}ull" for word in words[k : k + 6]) for k in range(0, len(words), 6)
    ]
    return f"static const unsigned long long {name}[] = {{\n    " + ",\n    ".join(rows) + "};\n"
