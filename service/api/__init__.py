"""The HTTP side: one file per resource. Nothing below this package knows a route, a header or a status code."""
