"""What a client can learn of a model before it asks: its tensors with units and ranges, and Triton's configuration."""

from __future__ import annotations

from pydantic import BaseModel, Field

from model_store import Manifest, ModelStore, Resolved
from service.api.v2.signature import (
    DEFAULT_HORIZON_S,
    DEFAULT_STEP_S,
    INPUTS,
    OUTPUTS,
    InputTensor,
    OutputTensor,
)
from service.api.v2.wire import Parameters
from service.learning.band import HIGHEST_LEVEL, LOWEST_LEVEL, USUAL_LEVEL
from service.settings import LIMITS
from service.twin import Frame
from service.wire.batch import MAX_SCENARIOS

PLATFORM = "rover-twin_safetensors"
_TRITON_TYPES = {"BYTES": "TYPE_STRING"}  # all others are TYPE_ and the name


class TensorMetadata(BaseModel):
    """One tensor; -1 is a dimension of any length."""

    name: str
    datatype: str
    shape: list[int]
    parameters: Parameters = Field(
        description="`unit`, `description`; of inputs `minimum`, `maximum`, `optional` and, where known, between "
        "which values this version was trained; of outputs whether they are sent without being asked for."
    )


class ModelMetadata(BaseModel):
    """A version of a model; `versions` lists all there are."""

    name: str
    versions: list[str]
    platform: str
    inputs: list[TensorMetadata]
    outputs: list[TensorMetadata]
    parameters: Parameters = Field(description="The version this is about, and the parameters of a request.")


class ConfiguredTensor(BaseModel):
    """One tensor in Triton's configuration; -1 is a dimension of any length."""

    name: str
    data_type: str
    dims: list[int]


class ConfiguredInput(ConfiguredTensor):
    """One input tensor."""

    optional: bool


class SpecificVersions(BaseModel):
    """The versions that are served under this address."""

    versions: list[int]


class VersionPolicy(BaseModel):
    """Always the kind `specific`."""

    specific: SpecificVersions


class ModelConfiguration(BaseModel):
    """Triton's configuration of a model, as far as it applies."""

    name: str
    platform: str
    backend: str
    version_policy: VersionPolicy
    max_batch_size: int
    input: list[ConfiguredInput]
    output: list[ConfiguredTensor]


def metadata_of(store: ModelStore, reference: str) -> ModelMetadata:
    """Read from the store, so that it loads nothing. Raises what the store raises."""
    resolved, manifest = _version(store, reference)
    return ModelMetadata(
        name=resolved.name,
        versions=[str(version) for version in store.versions(resolved.name)],
        platform=PLATFORM,
        inputs=[_input(each, manifest) for each in INPUTS.values()],
        outputs=[_output(each) for each in _outputs(manifest)],
        parameters=_parameters(manifest),
    )


def configuration_of(store: ModelStore, reference: str) -> ModelConfiguration:
    """Triton's model configuration, as far as it applies. Raises what the store raises."""
    resolved, manifest = _version(store, reference)
    return ModelConfiguration(
        name=resolved.name,
        platform=PLATFORM,
        backend="rover-twin",
        version_policy=VersionPolicy(specific=SpecificVersions(versions=[resolved.version])),
        max_batch_size=0,  # scenarios are a dimension of the tensors, since times have none
        input=[
            ConfiguredInput(name=each.name, data_type="TYPE_FP64", dims=[-1], optional=not each.required)
            for each in INPUTS.values()
        ],
        output=[
            ConfiguredTensor(
                name=each.name,
                data_type=_TRITON_TYPES.get(each.datatype, f"TYPE_{each.datatype}"),
                dims=[-1] * each.rank,
            )
            for each in _outputs(manifest)
        ],
    )


def _version(store: ModelStore, reference: str) -> tuple[Resolved, Manifest]:
    resolved = store.resolve(reference)
    return resolved, store.manifest(resolved.name, resolved.version)


def _outputs(manifest: Manifest) -> list[OutputTensor]:
    return [each for each in OUTPUTS.values() if manifest.band is not None or not each.of_band]


def _input(tensor: InputTensor, manifest: Manifest) -> TensorMetadata:
    parameters: Parameters = {
        "unit": tensor.unit,
        "minimum": tensor.lowest,
        "maximum": tensor.highest,
        "optional": not tensor.required,
        "description": tensor.meaning,
    }
    span = manifest.domain.get(tensor.name)
    if isinstance(span, list) and len(span) == len(("lowest", "highest")):
        for name, value in zip(("trained_minimum", "trained_maximum"), span, strict=True):
            if isinstance(value, int | float):
                parameters[name] = value
    if tensor.name == "horizon_s":
        parameters["default"] = DEFAULT_HORIZON_S
    return TensorMetadata(name=tensor.name, datatype="FP64", shape=[-1], parameters=parameters)


def _output(tensor: OutputTensor) -> TensorMetadata:
    parameters: Parameters = {"description": tensor.meaning, "on_request": not tensor.usual}
    if tensor.unit:
        parameters["unit"] = tensor.unit
    if len(tensor.frames) == 1:
        parameters["frame"] = next(iter(tensor.frames)).value
    return TensorMetadata(name=tensor.name, datatype=tensor.datatype, shape=[-1] * tensor.rank, parameters=parameters)


def _parameters(manifest: Manifest) -> Parameters:
    known: Parameters = {
        "version": str(manifest.version),
        "description": manifest.description,
        "max_scenarios": MAX_SCENARIOS,
        "frame": "|".join(Frame),
        "frame_default": Frame.SLOPE.value,
        "dt_s_minimum": LIMITS.dt_s[0],
        "dt_s_maximum": LIMITS.dt_s[1],
        "dt_s_default": DEFAULT_STEP_S,
    }
    if manifest.band is not None:
        known |= {
            "band_level_minimum": LOWEST_LEVEL,
            "band_level_maximum": HIGHEST_LEVEL,
            "band_level_default": USUAL_LEVEL,
        }
    return known
