"""What is asked and answered, whatever carries it: fields, ranges, faults, forms. Knows neither HTTP nor commands."""
