"""A rover's drive: motion over slopes and under torques that change, from any state on, by a compiled engine.

`law.py` has the equation's numbers, `native/law.c` its formulas, `engine.py` what can be asked.
"""
