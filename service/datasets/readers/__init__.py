"""Files as people and programs write them, as tables with their places."""
