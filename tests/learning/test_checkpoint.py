from __future__ import annotations

import copy
import json

import numpy as np
import pytest
import safetensors.numpy

from service.errors import CheckpointError
from service.learning.checkpoint import describe_model, restore_model, weights_bytes
from service.learning.network.model import PhysicsInformedModel
from service.physics.scenario import Scenarios
from tests.learning.network.test_model import model

TIME = np.linspace(0, 4, 50)
ONE = Scenarios.of(12, 500, 70)


def saved(source: PhysicsInformedModel) -> tuple[dict, bytes]:
    return json.loads(json.dumps(describe_model(source), allow_nan=False)), weights_bytes(source)


@pytest.mark.parametrize("prior", ["rigid_slope", "motor_slope"])
@pytest.mark.parametrize("arguments", [{}, {"x_form": "mean_speed", "output_scale_m": (0.7, 0.01)}])
def test_a_restored_model_answers_the_same(prior, arguments):
    source = model(prior, **arguments)
    restored = restore_model(*saved(source))
    np.testing.assert_array_equal(restored.positions(ONE, TIME).x_m, source.positions(ONE, TIME).x_m)
    np.testing.assert_array_equal(restored.positions(ONE, TIME).y_m, source.positions(ONE, TIME).y_m)
    assert saved(restored) == saved(source)


def test_the_zero_residual_is_a_checkpoint_too():
    source = model(architecture="zero")
    np.testing.assert_array_equal(
        restore_model(*saved(source)).positions(ONE, TIME).x_m, source.positions(ONE, TIME).x_m
    )


@pytest.mark.parametrize("length", [0, 7, 100, -1])
def test_truncated_weights_are_refused(length):
    description, weights = saved(model())
    with pytest.raises(CheckpointError, match="cannot be read as safetensors"):
        restore_model(description, weights[:length])


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused(bad):
    source = model()
    description, _ = saved(source)
    tensors = {name: tensor.copy() for name, tensor in source.correction.tensors.items()}
    tensors["layers.4.weight"][3, 5] = bad
    with pytest.raises(CheckpointError, match=r"layers\.4\.weight holds values that are not finite"):
        restore_model(description, safetensors.numpy.save(tensors))


def test_weights_of_another_shape_are_refused():
    source = model()
    description, _ = saved(source)
    tensors = {name: tensor.copy() for name, tensor in source.correction.tensors.items()}
    tensors["layers.0.weight"] = np.zeros((30, 4), np.float32)
    with pytest.raises(CheckpointError, match=r"layers\.0\.weight is .*\(30, 4\), the architecture needs .*\(30, 5\)"):
        restore_model(description, safetensors.numpy.save(tensors))


def test_missing_weights_are_refused():
    description, _ = saved(model())
    with pytest.raises(CheckpointError, match="the architecture needs"):
        restore_model(description, safetensors.numpy.save({"other": np.zeros(1)}))


def _set(path: list[str | int], value: object):
    def change(description: dict) -> None:
        place = description
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (_set(["architecture", "name"], "builtins.eval"), "allowed is one of paper_network, zero"),
        (_set(["architecture", "arguments"], {"input_count": 5, "evil": 1}), "evil"),
        (_set(["architecture", "arguments"], None), "does not fit"),
        (_set(["prior", "name"], "dune"), "allowed is one of rigid_slope, motor_slope"),
        (_set(["prior", "rover", "wheel_radius_m"], 0), "wheel_radius_m must be positive"),
        (_set(["prior", "rover"], {}), "does not fit"),
        (_set(["inputs", 1, "name"], "colour"), "allowed is one of time_s"),
        (_set(["inputs", 1, "scale"], 0), "positive scale"),
        (_set(["inputs"], []), "must begin with time_s"),
        (_set(["inputs"], [{"name": "time_s", "centre": 1, "scale": 1}]), "takes 5 inputs, the signature names 1"),
        (_set(["outputs"], []), "outputs are"),
    ],
)
def test_a_description_that_does_not_fit_says_why(change, reason):
    description, weights = saved(model())
    changed = copy.deepcopy(description)
    change(changed)
    with pytest.raises(CheckpointError, match=reason):
        restore_model(changed, weights)


@pytest.mark.parametrize("missing", ["architecture", "inputs", "outputs", "prior"])
def test_a_missing_part_is_named(missing):
    description, weights = saved(model())
    del description[missing]
    with pytest.raises(CheckpointError, match=f"'{missing}' is missing"):
        restore_model(description, weights)


def test_a_version_of_a_former_architecture_says_what_it_is_and_what_to_do():
    description, weights = saved(model())
    description["architecture"] = {"name": "resistance_process", "arguments": {}}
    with pytest.raises(CheckpointError, match=r"a resistance process.*train anew.*--architecture drive_model.*release"):
        restore_model(description, weights)
