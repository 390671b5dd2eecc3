"""Whole drives as clients ask for them and as they are answered: fields, ranges, subjects for the forms."""
