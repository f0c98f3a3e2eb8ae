"""Description of an FMU: variables with units, as the XML text of FMI 2.0."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..plant.signals import get_signal

INPUT, PARAMETER, OUTPUT = "input", "parameter", "output"

_SYMBOLS: dict[str, tuple[float, dict[str, int]]] = {
    "m": (1.0, {"m": 1}),
    "mm": (1e-3, {"m": 1}),
    "s": (1.0, {"s": 1}),
    "kg": (1.0, {"kg": 1}),
    "g": (1e-3, {"kg": 1}),
    "rad": (1.0, {"rad": 1}),
    "deg": (math.pi / 180.0, {"rad": 1}),
    "A": (1.0, {"A": 1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
}
"""Units of the signal registry: factor to SI base units, and their exponents."""


class Variable(NamedTuple):
    """One real variable of an FMU."""

    slot: int  # value reference
    name: str
    causality: str  # INPUT, PARAMETER or OUTPUT
    unit: str  # as in the signal registry, such as N m
    description: str
    start: float = 0.0  # of an input or a parameter
    low: float = -math.inf
    high: float = math.inf


def measured_column(name: str) -> str:
    """Return the column of a signal as a controller measures it, not its true value.

    Example:
        >>> measured_column("shaft_speed")
        'shaft_speed_rad_s'
    """
    return get_signal(name).column.removeprefix("true_")


def base_unit(unit: str) -> tuple[float, dict[str, int]] | None:
    """Return the factor of a unit to SI base units and the exponents of these; None if unknown.

    Example:
        >>> base_unit("N m")
        (1.0, {'kg': 1, 'm': 2, 's': -2})
    """
    if unit in ("-", "1", ""):
        return 1.0, {}
    factor, exponents = 1.0, dict[str, int]()
    numerator, *denominators = unit.split("/")
    for sign, part in ((1, numerator), *((-1, part) for part in denominators)):
        for word in re.split(r"[ .*]", part):
            found = re.fullmatch(r"([A-Za-z]+)\^?(\d?)", word)
            if found is None or found[1] not in _SYMBOLS:
                return None
            power = sign * int(found[2] or 1)
            scale, base = _SYMBOLS[found[1]]
            factor *= scale**power
            for name, exponent in base.items():
                exponents[name] = exponents.get(name, 0) + power * exponent
    return factor, {name: exponent for name, exponent in exponents.items() if exponent}


def fmi_unit(unit: str) -> str:
    """Return a unit of the signal registry as FMI spells it: ``N.m``, and ``1`` without a unit."""
    return "1" if unit in ("-", "") else unit.replace(" ", ".")


def model_description(
    identifier: str,
    guid: str,
    description: str,
    variables: Sequence[Variable],
    step_s: float,
    version: str,
    sources: Collection[str] = (),
) -> bytes:
    """Return the XML text of a co-simulation FMU.

    Args:
        identifier: model identifier, a C identifier.
        guid: identifies the binary.
        description: one line.
        variables: variables in the order of the description.
        step_s: time step [s]; communication steps are multiples of it.
        version: version of the tool.
        sources: C files in the folder ``sources``, if any.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=identifier,
        guid=guid,
        description=description,
        generationTool=f"shaftline {version}",
        variableNamingConvention="flat",
    )
    yes = (
        "canHandleVariableCommunicationStepSize",
        "canNotUseMemoryManagementFunctions",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
    )
    part = SubElement(
        root, "CoSimulation", {"modelIdentifier": identifier, **dict.fromkeys(yes, "true")}
    )
    if sources:
        files = SubElement(part, "SourceFiles")
        for name in sources:
            SubElement(files, "File", name=name)
    definitions = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in variables):
        entry = SubElement(definitions, "Unit", name=fmi_unit(unit))
        if (found := base_unit(unit)) is not None:
            factor, exponents = found
            scale = {} if factor == 1.0 else {"factor": repr(factor)}
            SubElement(entry, "BaseUnit", {name: str(k) for name, k in exponents.items()} | scale)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="errors of the FMU")
    SubElement(root, "DefaultExperiment", startTime="0", stopTime="600", stepSize=repr(step_s))
    entries = SubElement(root, "ModelVariables")
    for variable in variables:
        about = {
            "name": variable.name,
            "valueReference": str(variable.slot),
            "description": variable.description,
            "causality": variable.causality,
        }
        if variable.causality == PARAMETER:
            about["variability"] = "fixed"
        real = {"unit": fmi_unit(variable.unit)}
        for key, bound in (("min", variable.low), ("max", variable.high)):
            if math.isfinite(bound):
                real[key] = repr(float(bound))
        if variable.causality != OUTPUT:
            real["start"] = repr(float(variable.start))
        SubElement(SubElement(entries, "ScalarVariable", about), "Real", real)
    structure = SubElement(root, "ModelStructure")
    for kind in ("Outputs", "InitialUnknowns"):
        unknowns = SubElement(structure, kind)
        for k, variable in enumerate(variables, start=1):
            if variable.causality == OUTPUT:
                SubElement(unknowns, "Unknown", index=str(k))
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text
