"""`/v2`: the Open Inference Protocol V2, as standard inference clients speak it, with Triton's extensions.

Requests are tensors of scenarios, answers tensors of trajectories. `routes.install` adds it to the app; the rest is
split by subject: `signature` (which tensors there are), `wire` (bodies), `question` (what was asked), `answer`,
`repository`, `statistics`, `failures`.
"""
