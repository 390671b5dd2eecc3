"""Who is asking: tokens by name, the address of a client, and how many wrong tokens came from it. Knows no HTTP."""
