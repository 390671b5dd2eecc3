"""Rover Twin: trajectories of a rover on a regolith slope, from a closed-form ODE plus a learned residual."""

from pydantic import BaseModel

__version__ = "0.1.0"

# Of all processes that this package is for: what checks the values of a model is put together when the first come.
# Of 240 models, those of the libraries among them, a service that starts needs a dozen, and a command fewer.
BaseModel.model_config["defer_build"] = True
