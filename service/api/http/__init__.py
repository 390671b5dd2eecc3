"""What knows HTTP and no rover: reading, negotiation, delivery, errors, middlewares."""
