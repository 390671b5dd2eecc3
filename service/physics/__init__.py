"""Closed-form priors, rover and regolith parameters, frames. NumPy float64, SI units and radians, no I/O."""
