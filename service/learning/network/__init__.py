"""The paper's network over a prior: inputs, residual, fit and checkpoint. Imports torch."""
