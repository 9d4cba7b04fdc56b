"""The HTTP API (docs/api.md): a run's schema, policy, metrics and workers over HTTP.

`process.ApiProcess` runs it beside a training, `server.serve` runs it in this process. It imports no
simulator and no torch.
"""
