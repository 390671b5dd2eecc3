"""What operators do: datasets, training jobs, aliases, versions out of use, and the record of it."""
