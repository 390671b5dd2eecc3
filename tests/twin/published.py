"""Real versions in a real store, made without training: zero residual over the motor prior."""

from __future__ import annotations

import safetensors.numpy
import torch

from model_store import WEIGHTS, Lineage, Manifest, ManifestDraft, ModelStore
from service.learning.band import BAND_FILE, Band
from service.learning.checkpoint import describe_model, weights_bytes
from service.learning.domain import Domain
from service.learning.network.corrections import ZeroCorrection
from service.learning.network.inputs import InputSignature
from service.learning.network.model import PhysicsInformedModel
from service.learning.network.residuals import make_residual
from service.learning.observed import scenarios_of
from service.physics.parameters import LUNAR_REGOLITH, VIPER
from service.physics.priors import make_prior
from tests.learning.left_out import domain_of, synthetic_band
from tests.learning.synthetic import HORIZON_S, synthetic_runs


def zero_model(resistance: float = 0.3) -> PhysicsInformedModel:
    names = ("time_s", "slope_deg")
    signature = InputSignature.fitted(names, scenarios_of(synthetic_runs()), HORIZON_S, VIPER, LUNAR_REGOLITH)
    prior = make_prior("motor_slope", resistance)
    return PhysicsInformedModel(prior, signature, ZeroCorrection(2))


def network_model(seed: int = 1, bias_m: float = 0.0) -> PhysicsInformedModel:
    """The paper's network with random weights; `bias_m` shifts both outputs."""
    torch.manual_seed(seed)
    network = make_residual("paper_network", {"input_count": 2})
    with torch.no_grad():
        network.state_dict()["layers.8.bias"].fill_(bias_m)
    zero = zero_model()
    return PhysicsInformedModel(zero.prior, zero.signature, network.correction())


def draft(model: PhysicsInformedModel, **checkpoint: object) -> ManifestDraft:
    return ManifestDraft(
        created_by="a test",
        checkpoint=describe_model(model) | {"wheel_motion_resistance": 0.17} | checkpoint,
        domain=Domain.of_runs(synthetic_runs(), VIPER, LUNAR_REGOLITH).describe(),
        metrics={},
        lineage=Lineage(),
    )


def publish(store: ModelStore, name: str = "unit", model: PhysicsInformedModel | None = None) -> Manifest:
    model = model or zero_model()
    return store.publish(name, {WEIGHTS: weights_bytes(model)}, draft(model))


def publish_banded(store: ModelStore, name: str = "unit", band: Band | None = None) -> Manifest:
    """A version with a band and a domain that knows its runs."""
    band = band or synthetic_band()
    files = {WEIGHTS: weights_bytes(zero_model()), BAND_FILE: safetensors.numpy.save(band.tensors())}
    described = {"domain": domain_of(synthetic_runs()).describe(), "band": band.describe()}
    return store.publish(name, files, draft(zero_model()).model_copy(update=described))


def publish_champion(store: ModelStore, name: str = "unit", model: PhysicsInformedModel | None = None) -> Manifest:
    manifest = publish(store, name, model)
    store.move_alias(name, "champion", manifest.version, actor="a test", reason="newest")
    return manifest
