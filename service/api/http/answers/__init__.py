"""How an answer travels: form and coding by what is asked, entity tag, parts of it, prepared headers."""
