"""The `rover-twin` command line: one file per command group, the same words as the API.

Modules here import the heavy parts (torch, pyarrow, fastapi) inside the commands that need them, so that
`rover-twin --help` answers at once.
"""
