"""A version as an FMU (Functional Mock-up Unit): a drive model that runs inside other simulators, without us.

An FMU is an archive: a description of its variables, a library for each platform (`native/`, compiled when the package
is installed), and the numbers of the law as a resource. No HTTP here.
"""

from __future__ import annotations

from service.fmu.archive import Fmi, fmu_bytes, tag_of
from service.fmu.cache import FmuCache

__all__ = ["Fmi", "FmuCache", "fmu_bytes", "tag_of"]
