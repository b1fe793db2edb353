"""How many participants the planned analysis needs, found by simulating the declared design."""
