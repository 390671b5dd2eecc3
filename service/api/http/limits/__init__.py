"""What bounds the work of many requests: threads, waiting, bytes of bodies and of answers."""
