"""The calls of the client, sent over the network."""
