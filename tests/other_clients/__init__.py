"""Clients of other projects against the service, as docs/clients.md shows them: `make other-clients`."""
