"""Resistance process: motor and traction laws for the drive, a Gaussian process for what the soil takes from it.

`model` predicts, `fit` learns. Import from those: a server that only predicts need not wait for scipy, which `fit`
uses.
"""
