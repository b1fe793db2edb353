"""HTTP and nothing else: a view parses, lets `study` decide, lets `storage` store, and answers."""
