"""What differs between tasks and threads. Each pair has one interface; `generate_sync.py` changes one for the other."""
