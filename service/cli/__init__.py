"""The `rover-twin` command line: one file per command group, the same words as the API.

Modules here import the heavy parts (torch, pyarrow, fastapi) inside the commands that need them, so that
`rover-twin --help` answers at once.
"""

from pydantic import BaseModel

# Only here, where the process is ours: `service.local` is a guest in another program. What checks the values of a
# model is put together when the first come. Of 240 models, those of the libraries among them, a service that starts
# needs a dozen, and a command fewer.
BaseModel.model_config["defer_build"] = True
