"""How the tables came to be, one step per file of `versions`; run by `Database.upgrade`."""
