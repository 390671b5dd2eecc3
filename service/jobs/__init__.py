"""Long work: importing datasets and training versions. Plain functions; the queue around them comes later."""
