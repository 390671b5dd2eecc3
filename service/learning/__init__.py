"""Residual networks over a prior: scaling, fit, evaluation, checkpoint <-> weights. No files, no store, no web."""
