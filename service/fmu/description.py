"""`modelDescription.xml`: what an importer learns of an FMU before it loads a library."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from xml.etree import ElementTree as Xml

import service
from service.fmu.variables import REFERENCES, VARIABLES, Role, Variable

LICENSE = "Apache-2.0"
_COPYRIGHT = "The Rover Twin authors"
_UNITS: dict[str, dict[str, str]] = {
    "s": {"s": "1"},
    "deg": {"rad": "1", "factor": repr(math.pi / 180.0)},
    "N.m": {"kg": "1", "m": "2", "s": "-2"},
    "kg": {"kg": "1"},
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "rad/s": {"rad": "1", "s": "-1"},
    "1": {},
}
_EXPERIMENT = {"startTime": "0.0", "stopTime": "20.0", "stepSize": "0.1"}
_LOG = {"logStatusError": "What was refused, and why", "logStatusWarning": "What is not looked at"}


@dataclass(frozen=True, slots=True)
class About:
    """What an FMU says of itself. `identifier` is the name of its libraries, a C identifier."""

    name: str
    identifier: str
    token: str
    description: str
    version: str
    author: str
    made_at: datetime


def description_xml(about: About, fmi: str) -> bytes:
    """The whole file, for "2.0" or "3.0"."""
    root = Xml.Element("fmiModelDescription", _attributes(about, fmi))
    Xml.SubElement(root, "CoSimulation", {"modelIdentifier": about.identifier, **_abilities(fmi)})
    units = Xml.SubElement(root, "UnitDefinitions")
    for name, base in _UNITS.items():
        Xml.SubElement(Xml.SubElement(units, "Unit", {"name": name}), "BaseUnit", base)
    categories = Xml.SubElement(root, "LogCategories")
    for name, meaning in _LOG.items():
        Xml.SubElement(categories, "Category", {"name": name, "description": meaning})
    Xml.SubElement(root, "DefaultExperiment", _EXPERIMENT)
    variables = Xml.SubElement(root, "ModelVariables")
    for variable in VARIABLES:
        _variable2(variables, variable) if fmi == "2.0" else _variable3(variables, variable)
    structure = Xml.SubElement(root, "ModelStructure")
    _structure2(structure) if fmi == "2.0" else _structure3(structure)
    Xml.indent(root)
    return bytes(Xml.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _attributes(about: About, fmi: str) -> dict[str, str]:
    return {
        "fmiVersion": fmi,
        "modelName": about.name,
        "guid" if fmi == "2.0" else "instantiationToken": about.token,
        "description": about.description,
        "author": about.author,
        "version": about.version,
        "copyright": _COPYRIGHT,
        "license": LICENSE,
        "generationTool": f"rover-twin {service.__version__}",
        "generationDateAndTime": about.made_at.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "variableNamingConvention": "flat",
    }


def _abilities(fmi: str) -> Mapping[str, str]:
    either = {
        "needsExecutionTool": "false",
        "canHandleVariableCommunicationStepSize": "true",
        "canBeInstantiatedOnlyOncePerProcess": "false",
    }
    if fmi == "2.0":
        return either | {
            "canInterpolateInputs": "false",
            "maxOutputDerivativeOrder": "0",
            "canRunAsynchronuously": "false",
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            "providesDirectionalDerivative": "false",
        }
    return either | {
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "false",
        "hasEventMode": "false",
        "canReturnEarlyAfterIntermediateUpdate": "false",
    }


def _common(variable: Variable) -> dict[str, str]:
    found = {
        "name": variable.name,
        "valueReference": str(REFERENCES[variable.name]),
        "description": variable.description,
        "causality": variable.role.value,
        "variability": variable.variability,
    }
    initial = {Role.PARAMETER: "exact", Role.OUTPUT: "calculated"}.get(variable.role)
    return found | ({"initial": initial} if initial else {})


def _of_type(variable: Variable) -> dict[str, str]:
    found = {}
    if variable.start is not None:
        found["start"] = str(variable.start).lower()
    if variable.unit is not None:
        found["unit"] = variable.unit
    if variable.low is not None and variable.high is not None:
        found |= {"min": repr(variable.low), "max": repr(variable.high)}
    return found


def _variable2(parent: Xml.Element, variable: Variable) -> None:
    scalar = Xml.SubElement(parent, "ScalarVariable", _common(variable))
    Xml.SubElement(scalar, "Boolean" if variable.boolean else "Real", _of_type(variable))


def _variable3(parent: Xml.Element, variable: Variable) -> None:
    Xml.SubElement(parent, "Boolean" if variable.boolean else "Float64", _common(variable) | _of_type(variable))


def _structure2(structure: Xml.Element) -> None:
    """FMI 2 counts variables from 1. Outputs depend on states alone: no input acts on them but by a step."""
    outputs, unknowns = Xml.SubElement(structure, "Outputs"), Xml.SubElement(structure, "InitialUnknowns")
    for name, known_from in _outputs():
        index = str(REFERENCES[name] + 1)
        Xml.SubElement(outputs, "Unknown", {"index": index, "dependencies": ""})
        on = " ".join(str(REFERENCES[each] + 1) for each in known_from)
        Xml.SubElement(unknowns, "Unknown", {"index": index, "dependencies": on})


def _structure3(structure: Xml.Element) -> None:
    for name, _ in _outputs():
        Xml.SubElement(structure, "Output", {"valueReference": str(REFERENCES[name]), "dependencies": ""})
    for name, known_from in _outputs():
        on = " ".join(str(REFERENCES[each]) for each in known_from)
        Xml.SubElement(structure, "InitialUnknown", {"valueReference": str(REFERENCES[name]), "dependencies": on})


def _outputs() -> list[tuple[str, tuple[str, ...]]]:
    return [(each.name, each.known_from) for each in VARIABLES if each.role is Role.OUTPUT]
