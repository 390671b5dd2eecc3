"""One instance of an FMU through FMPy, the same for both versions of the standard."""

from __future__ import annotations

import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave, fmi3LogMessageCallback

from service.fmu.variables import REFERENCES, VARIABLES

NUMBERS = [each.name for each in VARIABLES if not each.boolean]
BOOLEANS = [each.name for each in VARIABLES if each.boolean]
ERROR, WARNING = 3, 1


class Rover:
    """An instance; `said` are (status, message) of its log."""

    def __init__(self, made, name="rover"):
        self.description = read_model_description(str(made.folder))
        self.three = made.fmi == "3.0"
        self.said = []
        identifier = self.description.coSimulation.modelIdentifier
        kind = FMU3Slave if self.three else FMU2Slave
        self.fmu = kind(
            guid=self.description.guid,
            unzipDirectory=str(made.folder),
            modelIdentifier=identifier,
            instanceName=name,
        )
        self._instantiate()

    def _instantiate(self):
        if self.three:

            def log(_environment, status, _category, message):
                self.said.append((status, message.decode()))

            self._log = fmi3LogMessageCallback(log)
            self.fmu.instantiate(logMessage=self._log)
        else:

            def log(_environment, _name, status, _category, message):
                self.said.append((status, message.decode()))

            self._log = fmi2CallbackFunctions()
            self._log.logger = fmi2CallbackLoggerTYPE(log)
            self.fmu.instantiate(callbacks=self._log)

    def enter(self, start_s=0.0, stop_s=None):
        if not self.three:
            self.fmu.setupExperiment(startTime=start_s, stopTime=stop_s)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=start_s, stopTime=stop_s)

    def exit(self):
        self.fmu.exitInitializationMode()

    def begin(self, start_s=0.0, stop_s=None, **values):
        """Through initialisation, with start values."""
        self.enter(start_s, stop_s)
        self.set(**values)
        self.exit()
        return self

    def set(self, **values):
        numbers = {REFERENCES[n]: float(v) for n, v in values.items() if n in NUMBERS}
        booleans = {REFERENCES[n]: bool(v) for n, v in values.items() if n in BOOLEANS}
        assert len(numbers) + len(booleans) == len(values)
        if numbers:
            (self.fmu.setFloat64 if self.three else self.fmu.setReal)(list(numbers), list(numbers.values()))
        if booleans:
            self.fmu.setBoolean(list(booleans), list(booleans.values()))

    def get(self):
        """All values by name."""
        numbers, booleans = ([REFERENCES[name] for name in names] for names in (NUMBERS, BOOLEANS))
        found = (self.fmu.getFloat64 if self.three else self.fmu.getReal)(numbers)
        return dict(zip(NUMBERS, found, strict=True)) | dict(
            zip(BOOLEANS, map(bool, self.fmu.getBoolean(booleans)), strict=True)
        )

    def step(self, at_s, step_s):
        return self.fmu.doStep(currentCommunicationPoint=at_s, communicationStepSize=step_s)

    def keep(self):
        return self.fmu.getFMUState() if self.three else self.fmu.getFMUstate()

    def resume(self, state):
        (self.fmu.setFMUState if self.three else self.fmu.setFMUstate)(state)

    def forget(self, state):
        (self.fmu.freeFMUState if self.three else self.fmu.freeFMUstate)(state)

    def to_bytes(self):
        state = self.keep()
        data = (self.fmu.serializeFMUState if self.three else self.fmu.serializeFMUstate)(state)
        self.forget(state)
        return data

    def from_bytes(self, data):
        state = (self.fmu.deserializeFMUState if self.three else self.fmu.deSerializeFMUstate)(data)
        self.resume(state)
        self.forget(state)

    def refusal(self, call, *arguments, **named):
        """What is logged of a call that must give an error."""
        before = len(self.said)
        with pytest.raises(FMICallException) as refused:
            call(*arguments, **named)
        assert refused.value.status == ERROR
        assert len(self.said) == before + 1
        status, message = self.said[-1]
        assert status == ERROR
        return message

    def close(self):
        """Frees the instance, not the library: other instances have it."""
        if self.three:
            self.fmu.fmi3FreeInstance(self.fmu.component)
        else:
            self.fmu.fmi2FreeInstance(self.fmu.component)
