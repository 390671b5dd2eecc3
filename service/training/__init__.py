"""From stored datasets to a published version. Plain functions: the queue around them is `service.jobs`."""
