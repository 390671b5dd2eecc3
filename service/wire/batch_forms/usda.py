"""A batch as one USD text layer: a fleet, with one prim for each scenario or drive that is answered."""

from __future__ import annotations

import numpy as np

from service.wire.batch_forms.subject import BatchWritable
from service.wire.forms.placement import PLAIN, Placement, fleet_paths
from service.wire.forms.usda import Layer, Samples, rover, time_codes


def encode_batch_usda(subject: BatchWritable, placement: Placement = PLAIN) -> bytes:
    """The layer, UTF-8. All rovers share its time codes: dividing one by timeCodesPerSecond gives the float64 of
    `time_s`. The layer's own data say what is in the JSON answer beside the columns. Raises NonFiniteError.
    """
    about = {**subject.tables(), **subject.about(), **subject.extras()}
    indices = [int(index) for index in subject.indices]
    if not indices:
        return Layer(about, "no rover could be predicted", 1.0, 0.0, 0.0).text({}, placement).encode()
    rows = [subject.one(row) for row in range(len(indices))]
    shared, counts = subject.time_s(), subject.counts()
    everything = shared if shared.ndim == 1 else np.unique(shared)
    rate, codes = time_codes(everything)
    prims, samples = {}, Samples()
    for number, path in enumerate(fleet_paths(placement, indices)):
        own = codes if shared.ndim == 1 else codes[np.searchsorted(everything, shared[number, : counts[number]])]
        prims[path] = rover(rows[number], rows[number].stage(), placement.beside(indices[number]), path, own, samples)
    doc = f"{len(prims)} rovers, by their index among those asked for; each as in a layer of one"
    return samples.written(Layer(about, doc, rate, codes[0], codes[-1]).text(prims, placement))
