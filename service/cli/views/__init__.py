"""How the command line lays out its answers: tables and progress."""
