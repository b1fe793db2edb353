"""What is kept: the database, the instance folder it lives in, and the rows that leave it. The only place with SQL."""
