"""The API under `/v1`: one file per resource, its wire models beside it."""
