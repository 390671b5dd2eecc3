"""Connections before there is a request: who is let in, what of a head is read, when a connection is cut off."""
