"""Messy files: one clean run written in every way that people and programs write tables; see `axes` and `oracle`."""
