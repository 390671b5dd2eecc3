"""Rover Twin: trajectories of a rover on a regolith slope, from a closed-form ODE plus a learned residual."""

__version__ = "0.1.0"
