"""What a stranger sends, as a dataset: unpacked and read within bounds."""
