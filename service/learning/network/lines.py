"""Dense layers with ReLU between them, along a line: all inputs are fixed but the first. NumPy, float64.

Such layers are linear between the places where a unit is switched on or off, so along a line their outputs are a
polygon. Its corners follow layer by layer: before the first one everything is linear in the first input, and between
two corners of a layer the next one is linear too, until a unit of its own crosses zero (Sotoudeh and Thakur, Computing
Linear Restrictions of Neural Networks, NeurIPS 2019). Nothing is approximated. A hundred or two of corners stand for
any number of points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from service.physics.scenario import Array

# Rows that go through all layers together, and corners that go through one, so that the widest one's numbers stay in
# cache, the second ones also in memory that was used before: fresh pages took longer than the arithmetic.
_ROWS_AT_ONCE, _CORNERS_AT_ONCE = 256, 64
LARGEST = float(np.finfo(np.float32).max)
"""Above that the layers, whose weights are float32, count as without an answer."""


@dataclass(frozen=True, slots=True, eq=False)
class DenseLayers:
    """Weights of shape (input, output) and biases of shape (output,) of two layers or more, float64."""

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def line(self, others: Array) -> Line:
        """The layers where all inputs but the first are `others`, shape (input - 1,)."""
        first = self.weights[0]
        return Line(self, first[0], others @ first[1:] + self.biases[0])


@dataclass(frozen=True, slots=True, eq=False)
class Polygon:
    """A function that is linear between corners: rising places (corner,), values (corner, output)."""

    places: Array
    values: Array

    def at(self, inputs: Array) -> Array:
        """Its values at `inputs` (row,), which lie between the first and the last corner; shape (output, row)."""
        return np.stack([np.interp(inputs, self.places, column) for column in self.values.T])


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """`DenseLayers.line`; the first layer's units are `slope` times the input plus `offset`."""

    layers: DenseLayers
    slope: Array
    offset: Array

    def at(self, inputs: Array) -> Array:
        """Outputs for first inputs of shape (row,), by a pass through the layers; shape (output, row)."""
        outputs = np.empty((len(self.layers.biases[-1]), len(inputs)))
        for first in range(0, len(inputs), _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            found = self._first(inputs[rows])
            for weight, bias in self._others():
                # about half of the units add nothing to any row; what is no number is not among them
                alive = ~(found <= 0.0).all(axis=0)
                bent = found.compress(alive, axis=1)
                np.maximum(bent, 0.0, out=bent)
                found = bent @ weight.compress(alive, axis=0)
                found += bias
            outputs[:, rows] = found.T
        return outputs

    def polygon(self, start: float, end: float, most: int) -> Polygon | None:
        """The outputs between two inputs. None if they have more than `most` corners, or numbers beyond `LARGEST`."""
        places = np.array([start, end])
        found = self._first(places)
        for weight, bias in self._others():
            if not max(found.max(), -found.min()) <= LARGEST:  # NaN too
                return None
            above = found > 0.0
            left, share = _corners(found, above)
            if len(left) > most:
                return None
            right = np.minimum(left + 1, len(places) - 1)
            alive = above.any(axis=0)  # the others add nothing anywhere
            found = _product(found.compress(alive, axis=1), left, right, share, weight[alive])
            found += bias
            begin, end_ = places[left], places[right]
            places = np.minimum(begin + share * (end_ - begin), end_)
        return Polygon(places, found)

    def _first(self, inputs: Array) -> Array:
        return np.multiply.outer(inputs, self.slope) + self.offset

    def _others(self) -> zip[tuple[Array, Array]]:
        return zip(self.layers.weights[1:], self.layers.biases[1:], strict=True)


def _corners(units: Array, above: npt.NDArray[np.bool_]) -> tuple[npt.NDArray[np.intp], Array]:
    """Where ReLU bends units (corner, unit) that are linear between corners: at the corners, and where a unit crosses
    zero. In order, as the corner before and the share of the way from there to the next.
    """
    below = units < 0.0
    turned = (above[:-1] & below[1:]) | (below[:-1] & above[1:])
    crossing = np.flatnonzero(turned)  # of few among many, ten times as fast as `nonzero`
    count, width = units.shape
    flat, left = units.ravel(), crossing // width
    before = flat[crossing]
    share = before / (before - flat[crossing + width])
    left, share = np.concatenate([np.arange(count), left]), np.concatenate([np.zeros(count), share])
    order = np.lexsort((share, left))
    return left[order], share[order]


def _product(
    units: Array, left: npt.NDArray[np.intp], right: npt.NDArray[np.intp], share: Array, weight: Array
) -> Array:
    """ReLU of the units between corners, times the weights: some rows after the other, so that they stay in cache."""
    found = np.empty((len(left), weight.shape[1]))
    for first in range(0, len(left), _CORNERS_AT_ONCE):
        rows = slice(first, first + _CORNERS_AT_ONCE)
        bent, more = units[left[rows]], units[right[rows]]
        more -= bent
        more *= share[rows, None]
        bent += more
        np.maximum(bent, 0.0, out=bent)
        np.matmul(bent, weight, out=found[rows])
    return found
