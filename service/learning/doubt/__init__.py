"""How far to trust a model of motion: what its left-out predictions got wrong, as errors of the force balance.

A left-out prediction is wrong mostly as if the slope had been a little steeper or gentler. That `offset`, a fraction of
the weight added to the resistance, is what counts: near stalling a given one makes decimetres, elsewhere millimetres,
and how it grows over time, over a drive's stops and beyond the longest run is for the model to say. `doubt.Doubt`
answers with bands and with probabilities of outcomes; `meeting` is what a rover meets on its way, `scale` how large an
offset to expect there, `scores` what left-out runs were off by, `coverage` how often bands made without a run held it.
"""
